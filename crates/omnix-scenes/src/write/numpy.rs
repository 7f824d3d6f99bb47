//! Bytes of NPY arrays and NPZ archives (NPY 1.0, C order, little endian; archives as numpy's `savez` names their entries).

use std::io::{Cursor, Write as _};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

/// An NPY file of this numpy type, such as `<f4`.
pub(super) fn npy(dtype: &str, shape: &[usize], bytes: &[u8]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    // A tuple of one needs its comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({}{comma}), }}", sizes.join(", "));
    let unpadded = 10 + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut file = b"\x93NUMPY\x01\x00".to_vec();
    file.extend_from_slice(&(text.len() as u16).to_le_bytes());
    file.extend_from_slice(text.as_bytes());
    file.extend_from_slice(bytes);
    file
}

/// An NPZ file of named NPY files.
pub(super) fn npz(arrays: &[(&str, Vec<u8>)]) -> std::io::Result<Vec<u8>> {
    let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
    // The format's first date, so that equal arrays are equal files.
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .last_modified_time(zip::DateTime::default());
    for (name, file) in arrays {
        archive.start_file(format!("{name}.npy"), options)?;
        archive.write_all(file)?;
    }
    Ok(archive.finish()?.into_inner())
}

pub(super) fn f32_bytes(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

pub(super) fn f64_bytes(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(f64::to_le_bytes).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_padded_and_archives_may_be_empty() {
        let file = npy("<f4", &[3], &f32_bytes([1.0, 2.0, 3.0]));
        assert_eq!(file.len() % 64, 12);
        assert!(file.windows(4).any(|w| w == b"(3,)"));
        assert!(npz(&[]).unwrap().starts_with(b"PK"));
    }
}
