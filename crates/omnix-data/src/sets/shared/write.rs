//! Writing a scene in the shared layout.

use std::collections::BTreeMap;
use std::io::{Cursor, Write as _};
use std::path::Path;

use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage as _};
use image::{ExtendedColorType, ImageEncoder as _, codecs::png::PngEncoder};
use omnix_tensors::{AtomicFile, Dtype, TensorSpec, TensorWriter};

use super::{About, AboutTime, FORMAT, SIGNATURE, UNITS};
use crate::{DataError, Flag, Motion, Sample, Tracks};

/// Writes a sample as a scene: pictures as PNG, depth as OpenEXR (f32), masks, tracks, cameras last. Dense paths have no place in this
/// layout: those of the pixels in `points`, (image, pixel), become tracks. Every file appears under its name when it is whole, and
/// files of the same names are replaced.
///
/// # Errors
/// A point that is not in the sample; a failure of writing.
pub fn write(sample: &Sample, folder: &Path, points: &[(usize, usize)]) -> Result<(), DataError> {
    let [width, height] = sample.size();
    let names: Vec<String> = (0..sample.count()).map(|image| format!("{image:05}")).collect();
    for (image, name) in names.iter().enumerate() {
        let picture = png(sample.image(image), [width, height], ExtendedColorType::Rgb8, folder)?;
        put(&folder.join(format!("images/{name}.png")), &picture)?;
        if let Some(depth) = sample.depth(image) {
            let known = depth.iter().map(|z| if z.is_nan() { 0.0 } else { *z }).collect();
            put(&folder.join(format!("depths/{name}.exr")), &exr(known, [width, height], folder)?)?;
        }
        if let Some(moving) = sample.moving(image) {
            let level = |flag: &Flag| match flag {
                Flag::No => 0,
                Flag::Yes => 255,
                Flag::Unknown => 128u8,
            };
            let levels: Vec<u8> = moving.iter().map(level).collect();
            put(
                &folder.join(format!("moving/{name}.png")),
                &png(&levels, [width, height], ExtendedColorType::L8, folder)?,
            )?;
        }
    }
    let made;
    let tracks = match sample.motion() {
        Motion::Unknown => None,
        Motion::Tracks(tracks) => Some(tracks),
        Motion::Dense(_) if points.is_empty() => None,
        Motion::Dense(_) => {
            made = chosen(sample, points)?;
            Some(&made)
        }
    };
    if let Some(tracks) = tracks {
        write_tracks(tracks, sample.count(), folder)?;
    }
    let unit = UNITS.iter().find(|(unit, _)| *unit == sample.unit()).map_or("scene", |(_, name)| name);
    let times = sample.times().iter().map(|time| AboutTime {
        video: time.video,
        frame: time.frame,
        moment: time.moment,
        seconds: time.seconds,
    });
    let about = About { format: FORMAT.to_owned(), unit: unit.to_owned(), times: times.collect() };
    let pictures: Vec<String> = names.iter().map(|name| format!("{name}.png")).collect();
    put(&folder.join("image_names.json"), &json(&pictures, folder)?)?;
    put(&folder.join("omnix.json"), &json(&about, folder)?)?;
    let count = sample.count();
    let intrinsics = sample.cameras().iter().flat_map(|c| c.intrinsics.into_iter().flatten());
    put(&folder.join("intrinsics.npy"), &npy(&[count, 3, 3], intrinsics))?;
    let poses = sample.cameras().iter().flat_map(|c| c.extrinsics.into_iter().flatten());
    put(&folder.join(SIGNATURE[0]), &npy(&[count, 3, 4], poses))
}

/// The paths of some pixels as tracks.
fn chosen(sample: &Sample, points: &[(usize, usize)]) -> Result<Tracks, DataError> {
    if let Some((image, pixel)) = points.iter().find(|(i, p)| *i >= sample.count() || *p >= sample.pixels()) {
        return Err(DataError::NoPoint { image: *image, pixel: *pixel });
    }
    let mut tracks = Tracks { count: points.len(), ..Tracks::default() };
    for time in 0..sample.count() {
        for (source, pixel) in points {
            let position = sample.positions(*source, time).map_or([f32::NAN; 3], |map| map[*pixel]);
            tracks.positions.push(position);
            tracks.visible.push(sample.visible(*source, time).map_or(Flag::Unknown, |map| map[*pixel]));
        }
    }
    Ok(tracks)
}

fn write_tracks(tracks: &Tracks, count: usize, folder: &Path) -> Result<(), DataError> {
    let mut specs = vec![
        TensorSpec::new("positions", Dtype::F32, [count, tracks.count, 3]),
        TensorSpec::new("visible", Dtype::U8, [count, tracks.count]),
    ];
    if tracks.pixels.is_some() {
        specs.push(TensorSpec::new("pixels", Dtype::F32, [count, tracks.count, 2]));
    }
    let mut writer = TensorWriter::create(&folder.join("tracks.safetensors"), &specs, &BTreeMap::new())?;
    writer.write_f32("positions", tracks.positions.as_flattened())?;
    writer.write_bytes("visible", bytemuck::cast_slice(&tracks.visible))?;
    if let Some(pixels) = &tracks.pixels {
        writer.write_f32("pixels", pixels.as_flattened())?;
    }
    writer.finish()?;
    Ok(())
}

/// Writes a file that appears when it is whole.
pub(crate) fn put(path: &Path, bytes: &[u8]) -> Result<(), DataError> {
    let written = AtomicFile::create(path).and_then(|mut file| file.write_all(bytes).and_then(|()| file.commit()));
    written.map(drop).map_err(|source| DataError::Write { path: path.to_owned(), source })
}

/// An encoder's complaint, which has no file to blame: nothing of what is encoded here can be wrong but memory running out.
fn encoding(folder: &Path, error: impl std::error::Error + Send + Sync + 'static) -> DataError {
    DataError::Write { path: folder.to_owned(), source: std::io::Error::other(error) }
}

/// A picture as PNG.
pub(crate) fn png(
    pixels: &[u8],
    [width, height]: [u32; 2],
    colour: ExtendedColorType,
    folder: &Path,
) -> Result<Vec<u8>, DataError> {
    let mut bytes = Vec::new();
    PngEncoder::new(&mut bytes).write_image(pixels, width, height, colour).map_err(|e| encoding(folder, e))?;
    Ok(bytes)
}

fn exr(depth: Vec<f32>, [width, height]: [u32; 2], folder: &Path) -> Result<Vec<u8>, DataError> {
    let channel = AnyChannel::new("Y", FlatSamples::F32(depth));
    let channels = AnyChannels::sort([channel].into_iter().collect());
    let mut bytes = Cursor::new(Vec::new());
    let image = Image::from_channels((width as usize, height as usize), channels);
    image.write().to_buffered(&mut bytes).map_err(|e| encoding(folder, e))?;
    Ok(bytes.into_inner())
}

fn json<T: serde::Serialize>(value: &T, folder: &Path) -> Result<Vec<u8>, DataError> {
    serde_json::to_vec_pretty(value).map_err(|e| encoding(folder, e))
}

/// NPY 1.0 of f32, padded so that the data starts at a multiple of 64.
fn npy(shape: &[usize], values: impl Iterator<Item = f32>) -> Vec<u8> {
    let sizes: Vec<String> = shape.iter().map(ToString::to_string).collect();
    let mut text = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}), }}", sizes.join(", "));
    let unpadded = 10 + text.len() + 1;
    text.extend(std::iter::repeat_n(' ', unpadded.next_multiple_of(64) - unpadded));
    text.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((text.len() as u16).to_le_bytes());
    bytes.extend(text.as_bytes());
    bytes.extend(values.flat_map(f32::to_le_bytes));
    bytes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::read::ReadOptions;
    use crate::sets::tests_support::{agrees, picks};
    use crate::{made, sets};

    fn read(folder: &Path) -> Result<Sample, DataError> {
        let opened = sets::open(folder, None)?;
        crate::read::read(opened.as_ref(), &picks(opened.as_ref()), &ReadOptions::default())
    }

    fn written() -> (tempfile::TempDir, Sample, Vec<(usize, usize)>) {
        let dir = tempfile::tempdir().unwrap();
        let views: Vec<_> =
            (0..2).flat_map(|v| (0..2).map(move |f| (made::time(v, f), made::path([28, 14], v, f)))).collect();
        let mut parts = made::sample([28, 14], &views).into_parts();
        parts.depth.as_mut().unwrap()[9] = f32::NAN;
        parts.times[1].seconds = Some(0.25);
        let truth = Sample::new(parts).unwrap();
        let points: Vec<(usize, usize)> = (0..40).map(|k| (k % 4, k * 9)).collect();
        write(&truth, dir.path(), &points).unwrap();
        (dir, truth, points)
    }

    #[test]
    fn what_is_written_is_read_back() {
        let (dir, truth, points) = written();
        assert!(super::super::is_whole(dir.path()));
        let sample = read(dir.path()).unwrap();
        assert_eq!((sample.times(), sample.unit()), (truth.times(), truth.unit()));
        assert_eq!((sample.cameras(), sample.moving(3)), (truth.cameras(), truth.moving(3)));
        let mut same = truth.clone().into_parts();
        same.depth.as_mut().unwrap()[9] = truth.depth(0).unwrap()[8];
        assert!(sample.depth(0).unwrap()[9].is_nan());
        let Motion::Tracks(tracks) = sample.motion() else { panic!("no tracks") };
        for (k, (source, pixel)) in points.iter().enumerate() {
            assert_eq!(tracks.positions[2 * 40 + k], truth.positions(*source, 2).unwrap()[*pixel]);
            assert_eq!(tracks.visible[3 * 40 + k], truth.visible(*source, 3).unwrap()[*pixel]);
        }
        // Without our additions it is a scene of others.
        for file in ["omnix.json", "tracks.safetensors"] {
            std::fs::remove_file(dir.path().join(file)).unwrap();
        }
        std::fs::remove_dir_all(dir.path().join("moving")).unwrap();
        let sample = read(dir.path()).unwrap();
        assert_eq!(
            (sample.unit(), sample.motion(), sample.times()[3].frame),
            (crate::Unit::Scene, &Motion::Unknown, 3)
        );
        agrees(&sample, &truth, usize::MAX);
    }

    #[test]
    fn what_does_not_fit_is_named() {
        let (dir, ..) = written();
        let path = |name: &str| dir.path().join(name);
        let fails = |words: &str| {
            let error = read(dir.path()).unwrap_err().to_string();
            assert!(error.contains(words), "{words}: {error}");
        };
        made::exr(&path("depths/00001.exr"), [14, 28], &[1.0; 392]);
        fails("28 x 14");
        made::text(&path("image_names.json"), "[\"../../secret.png\", \"b\", \"c\", \"d\"]");
        fails("not the name of a picture");
        made::text(&path("image_names.json"), "[\"00000.png\"]");
        fails("[4, 3, 4]");
        made::text(&path("image_names.json"), "{");
        fails("image_names.json");
        std::fs::remove_file(path("image_names.json")).unwrap();
        fails("not there");
    }

    #[test]
    fn points_outside_are_refused() {
        let truth = made::video([4, 4], 1);
        let dir = tempfile::tempdir().unwrap();
        let error = write(&truth, dir.path(), &[(0, 16)]).unwrap_err();
        assert!(matches!(error, DataError::NoPoint { image: 0, pixel: 16 }), "{error}");
        assert!(!super::super::is_whole(dir.path()));
    }
}
