//! What a window said, in a file of its own: safetensors, `windows/NNNNNN.safetensors` with the window's number.
//!
//! For each of its images k: `depth.k`, `confidence.k` and, of networks with trajectories, `theta.k`, F32 `[H, W]`; `camera.k` F32 `[21]`:
//! extrinsics by rows (12 numbers), intrinsics by rows (9). All in the window's own world and scale. `__metadata__`: `format`, and `key`, the digest of
//! all that the numbers depend on.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use omnix_geometry::Camera;
use omnix_tensors::{Dtype, TensorError, TensorReader, TensorSpec, TensorWriter};

use crate::error::OmnixError;
use crate::field::WINDOW;

const FORMAT: &str = "omnix-window-1";
/// Numbers of a camera.
const CAMERA: usize = 21;

/// The file of window `k` in the folder of a film's windows.
#[must_use]
pub fn window_path(folder: &Path, k: usize) -> PathBuf {
    folder.join(format!("{k:06}.safetensors"))
}

/// The file of the field of window `k`, where fields are kept.
#[must_use]
pub fn field_path(folder: &Path, k: usize) -> PathBuf {
    folder.join(format!("{k:06}.field.safetensors"))
}

/// Whether a file is the field of the window with this digest.
pub(super) fn is_field_of(path: &Path, key: &str) -> bool {
    TensorReader::open(path).is_ok_and(|file| file.metadata().get(WINDOW).is_some_and(|of| of == key))
}

/// One image as a window has it, in the window's own world.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct WindowImage {
    pub(super) depth: Vec<f32>,
    pub(super) confidence: Vec<f32>,
    pub(super) theta: Option<Vec<f32>>,
    pub(super) camera: Camera,
}

/// Writes the file of a window; it has its name when it is whole.
pub(super) fn store(path: &Path, key: &str, size: [usize; 2], images: &[WindowImage]) -> Result<(), OmnixError> {
    let motion = images.iter().all(|image| image.theta.is_some());
    let mut specs = Vec::new();
    for k in 0..images.len() {
        let maps = ["depth", "confidence"].into_iter().chain(motion.then_some("theta"));
        specs.extend(maps.map(|map| TensorSpec::new(format!("{map}.{k}"), Dtype::F32, size)));
        specs.push(TensorSpec::new(format!("camera.{k}"), Dtype::F32, [CAMERA]));
    }
    let metadata = [("format", FORMAT), ("key", key)].map(|(name, text)| (name.to_owned(), text.to_owned()));
    let mut file = TensorWriter::create(path, &specs, &BTreeMap::from(metadata)).map_err(OmnixError::Window)?;
    let mut put = |name: String, numbers: &[f32]| file.write_f32(&name, numbers).map_err(OmnixError::Window);
    for (k, image) in images.iter().enumerate() {
        put(format!("depth.{k}"), &image.depth)?;
        put(format!("confidence.{k}"), &image.confidence)?;
        if let Some(theta) = image.theta.as_ref().filter(|_| motion) {
            put(format!("theta.{k}"), theta)?;
        }
        let Camera { extrinsics, intrinsics } = &image.camera;
        put(format!("camera.{k}"), &[extrinsics.as_flattened(), intrinsics.as_flattened()].concat())?;
    }
    file.finish().map_err(OmnixError::Window)?;
    Ok(())
}

/// A finished window.
#[derive(Debug)]
pub struct StoredWindow {
    reader: TensorReader,
    size: [usize; 2],
}

impl StoredWindow {
    /// Opens the file of a window of images of `[height, width]`.
    ///
    /// # Errors
    /// No such file, or one that is no window of such images.
    pub fn open(path: &Path, size: [usize; 2]) -> Result<Self, OmnixError> {
        let reader = TensorReader::open(path).map_err(OmnixError::Window)?;
        let fits = reader.info("depth.0").is_some_and(|info| info.shape == size);
        if reader.metadata().get("format").is_none_or(|format| format != FORMAT) || !fits {
            let reason = format!("it is no window of images of {}x{}", size[1], size[0]);
            return Err(OmnixError::Window(TensorError::NotSafetensors { reason, path: path.to_owned() }));
        }
        Ok(Self { reader, size })
    }

    /// The digest of what it depends on.
    #[must_use]
    pub fn key(&self) -> &str {
        self.reader.metadata().get("key").map_or("", String::as_str)
    }

    /// Image `k`, counted from the window's first.
    pub(super) fn image(&self, k: usize) -> Result<WindowImage, OmnixError> {
        let pixels = self.size[0] * self.size[1];
        let read = |name: &str, numbers: usize| {
            self.reader.read_f32(&format!("{name}.{k}"), 0..numbers).map_err(OmnixError::Window)
        };
        let theta = self.reader.info(&format!("theta.{k}")).is_some();
        let numbers = read("camera", CAMERA)?;
        let camera = Camera {
            extrinsics: std::array::from_fn(|i| std::array::from_fn(|j| numbers[4 * i + j])),
            intrinsics: std::array::from_fn(|i| std::array::from_fn(|j| numbers[12 + 3 * i + j])),
        };
        Ok(WindowImage {
            depth: read("depth", pixels)?,
            confidence: read("confidence", pixels)?,
            theta: if theta { Some(read("theta", pixels)?) } else { None },
            camera,
        })
    }
}

#[cfg(test)]
pub(super) fn made(pixels: usize, depth: impl Fn(usize) -> f32, theta: Option<f32>, camera: Camera) -> WindowImage {
    let depth: Vec<f32> = (0..pixels).map(depth).collect();
    WindowImage { depth, confidence: vec![2.0; pixels], theta: theta.map(|theta| vec![theta; pixels]), camera }
}

#[cfg(test)]
mod tests {
    use omnix_geometry::IDENTITY_POSE;

    use super::*;

    #[test]
    fn a_window_comes_back_bit_for_bit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("windows/000000.safetensors");
        let intrinsics = [[3.0, 0.5, 1.0], [0.0, 4.0, 2.0], [0.0, 0.0, 1.0]];
        let camera = Camera { extrinsics: IDENTITY_POSE, intrinsics };
        let images: Vec<WindowImage> = (0..3).map(|k| made(6, |p| 0.1 + (p + k) as f32, Some(0.25), camera)).collect();
        store(&path, "abc", [2, 3], &images).unwrap();
        let stored = StoredWindow::open(&path, [2, 3]).unwrap();
        assert_eq!(stored.key(), "abc");
        for (k, image) in images.iter().enumerate() {
            assert_eq!(&stored.image(k).unwrap(), image);
        }
        assert!(stored.image(3).is_err());
        assert!(StoredWindow::open(&path, [3, 2]).is_err(), "another size");
        std::fs::write(&path, &std::fs::read(&path).unwrap()[..200]).unwrap();
        assert!(StoredWindow::open(&path, [2, 3]).is_err(), "cut short");
    }
}
