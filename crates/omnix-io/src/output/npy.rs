//! NPY files and NPZ archives of whole arrays. Format: NPY version 1.0, C order, little endian; archives as numpy's `savez` names
//! them (`NAME.npy`), deflated, arrays above 64 MiB stored as they are, since packing floats takes longer than it saves.

use std::{io::Write, path::PathBuf};

use zip::{CompressionMethod, ZipWriter, write::SimpleFileOptions};

use super::atomic::AtomicFile;
use crate::IoError;

const STORED_ABOVE: usize = 64 << 20;

/// A whole array, ready to be written.
pub(super) struct Array {
    pub(super) name: &'static str,
    /// numpy's description, such as `<f4`.
    pub(super) dtype: &'static str,
    pub(super) shape: Vec<usize>,
    pub(super) bytes: Vec<u8>,
}

impl Array {
    pub(super) fn f32(name: &'static str, shape: Vec<usize>, values: impl IntoIterator<Item = f32>) -> Self {
        Self { name, dtype: "<f4", shape, bytes: values.into_iter().flat_map(f32::to_le_bytes).collect() }
    }

    pub(super) fn f64(name: &'static str, shape: Vec<usize>, values: impl IntoIterator<Item = f64>) -> Self {
        Self { name, dtype: "<f8", shape, bytes: values.into_iter().flat_map(f64::to_le_bytes).collect() }
    }

    pub(super) fn i32(name: &'static str, shape: Vec<usize>, values: impl IntoIterator<Item = i32>) -> Self {
        Self { name, dtype: "<i4", shape, bytes: values.into_iter().flat_map(i32::to_le_bytes).collect() }
    }

    pub(super) fn u8(name: &'static str, shape: Vec<usize>, bytes: Vec<u8>) -> Self {
        Self { name, dtype: "|u1", shape, bytes }
    }

    pub(super) fn bool(name: &'static str, shape: Vec<usize>, values: &[bool]) -> Self {
        Self { name, dtype: "|b1", shape, bytes: values.iter().map(|&v| u8::from(v)).collect() }
    }
}

/// NPY 1.0 header, padded so that the data starts at a multiple of 64.
pub(super) fn header(dtype: &str, shape: &[usize]) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    // A tuple of one needs its comma.
    let comma = if shape.len() == 1 { "," } else { "" };
    let mut text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({}{comma}), }}", sizes.join(", "));
    let unpadded = 10 + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend_from_slice(&(text.len() as u16).to_le_bytes());
    header.extend_from_slice(text.as_bytes());
    header
}

/// Writes one array as an NPY file.
pub(super) fn write_npy(path: PathBuf, array: &Array) -> Result<PathBuf, IoError> {
    let mut file = AtomicFile::create(path)?;
    file.put(&header(array.dtype, &array.shape))?;
    file.put(&array.bytes)?;
    file.commit()
}

/// Writes the arrays as one NPZ archive.
pub(super) fn write_npz(path: PathBuf, arrays: &[Array]) -> Result<PathBuf, IoError> {
    let mut file = AtomicFile::create(path.clone())?;
    let fail = |e: zip::result::ZipError| IoError::write(&path, e.into());
    let mut zip = ZipWriter::new(file.writer());
    for array in arrays {
        let stored = array.bytes.len() > STORED_ABOVE;
        let method = if stored { CompressionMethod::Stored } else { CompressionMethod::Deflated };
        let options = SimpleFileOptions::default().compression_method(method).large_file(array.bytes.len() > 1 << 30);
        zip.start_file(format!("{}.npy", array.name), options).map_err(fail)?;
        for part in [&header(array.dtype, &array.shape), &array.bytes] {
            zip.write_all(part).map_err(|e| IoError::write(&path, e))?;
        }
    }
    zip.finish().map_err(fail)?;
    file.commit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn header_is_padded() {
        for shape in [&[][..], &[7], &[24, 280, 504]] {
            let header = header("<f4", shape);
            assert_eq!(header.len() % 64, 0);
            assert_eq!(header.last(), Some(&b'\n'));
        }
        assert!(String::from_utf8_lossy(&header("<f4", &[7])).contains("'shape': (7,), "));
    }
}
