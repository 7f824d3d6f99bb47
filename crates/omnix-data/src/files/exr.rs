//! One map in an OpenEXR file: the only channel of its first layer, f16 or f32.

use std::path::Path;

use exr::image::{FlatSamples, read::read_first_flat_layer_from_file};
use exr::meta::MetaData;

use super::MOST;
use crate::DataError;

/// The map as f32, rows from the top, with its width and height.
pub(crate) fn read_exr(path: &Path) -> Result<([usize; 2], Vec<f32>), DataError> {
    match std::fs::metadata(path) {
        Ok(meta) if meta.is_file() => {}
        Ok(_) => return Err(DataError::NotAFile { path: path.to_owned() }),
        Err(source) => return Err(DataError::read(path, source)),
    }
    let refuse = |reason: String| DataError::Exr { reason, path: path.to_owned() };
    // The size before memory is taken for it.
    let meta = MetaData::read_from_file(path, false).map_err(|e| refuse(e.to_string()))?;
    let Some(header) = meta.headers.first() else {
        return Err(refuse("it has no layer".to_owned()));
    };
    let names: Vec<String> = header.channels.list.iter().map(|channel| channel.name.to_string()).collect();
    if names.len() != 1 {
        return Err(refuse(format!("it has the channels {}, and a map of depth has one", names.join(", "))));
    }
    let size = [header.layer_size.0, header.layer_size.1];
    if size[0].saturating_mul(size[1]).saturating_mul(4) as u64 > MOST {
        return Err(refuse(format!("it says that it has {} x {} pixels", size[0], size[1])));
    }
    let image = read_first_flat_layer_from_file(path).map_err(|e| refuse(e.to_string()))?;
    let Some(channel) = image.layer_data.channel_data.list.into_iter().next() else {
        return Err(refuse("it has no channel".to_owned()));
    };
    let values = match channel.sample_data {
        FlatSamples::F16(values) => values.into_iter().map(f32::from).collect(),
        FlatSamples::F32(values) => values,
        FlatSamples::U32(_) => return Err(refuse("its numbers are integers".to_owned())),
    };
    if values.len() != size[0] * size[1] {
        return Err(refuse(format!("it has {} numbers for {} x {} pixels", values.len(), size[0], size[1])));
    }
    Ok((size, values))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::made::{exr, exr_rgb};

    #[test]
    fn one_channel_is_read_and_more_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("00000.exr");
        exr(&path, [3, 2], &[1.0, 2.0, 3.0, 4.0, 5.0, 0.0]);
        assert_eq!(read_exr(&path).unwrap(), ([3, 2], vec![1.0, 2.0, 3.0, 4.0, 5.0, 0.0]));
        exr_rgb(&path, [3, 2]);
        let error = read_exr(&path).unwrap_err().to_string();
        assert!(error.contains("B, G, R"), "{error}");
    }

    #[test]
    fn what_is_no_exr_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("00000.exr");
        assert!(matches!(read_exr(&path), Err(DataError::Missing { .. })));
        exr(&path, [64, 64], &[1.5; 64 * 64]);
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 3, 40, bytes.len() / 2, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(matches!(read_exr(&path), Err(DataError::Exr { .. })), "{length} of {}", bytes.len());
        }
    }
}
