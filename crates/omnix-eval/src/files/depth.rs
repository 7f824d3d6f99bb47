//! Depth maps, and the depth of a sequence, from files.
//!
//! | format | value | unknown |
//! |---|---|---|
//! | KITTI, 16-bit grey PNG | value / 256 = metres | 0 |
//! | TUM and Bonn, 16-bit grey PNG | value / 5000 = metres | 0 |
//! | Sintel `.dpt` | f32 tag 202021.25, i32 width, i32 height, f32 metres, row by row, little endian | – |
//! | NPY `[H,W]`; NPZ with `depth` `[S,H,W]` | as it is | 0, negative, NaN |
//! | a run of omnix: `depth/depth.json` and 16-bit PNG, or `exports/npz/results.npz` | value * scale | 0 |
//!
//! Unknown depth reads as -1, as published readers have it, and as NaN in predictions.

use std::path::{Path, PathBuf};

use image::{DynamicImage, ImageFormat, ImageReader};

use super::npz::Archive;
use super::{folder, npy};
use crate::EvalError;

/// A depth map, row-major.
#[derive(Debug, Clone, PartialEq)]
pub struct DepthMap {
    /// Width and height.
    pub size: [usize; 2],
    /// z-depth.
    pub depth: Vec<f32>,
}

/// Tag of Sintel's files.
pub(super) const SINTEL_TAG: f32 = 202_021.25;

/// Reads KITTI's depth.
///
/// # Errors
/// [`EvalError::Read`], [`EvalError::Format`]: also for a picture without a value above 255, which is 8-bit depth in the wrong place.
pub fn read_kitti(path: &Path) -> Result<DepthMap, EvalError> {
    let (size, values) = grey16(path)?;
    if values.iter().all(|&v| v <= 255) {
        let reason = "no value is above 255, that is 1 m: this is not depth in 1/256 m";
        return Err(EvalError::format("KITTI depth", reason, path));
    }
    Ok(DepthMap { size, depth: values.iter().map(|&v| known(v, f64::from(v) / 256.0, -1.0)).collect() })
}

/// Reads the depth of TUM and Bonn.
///
/// # Errors
/// [`EvalError::Read`], [`EvalError::Format`].
pub fn read_tum(path: &Path) -> Result<DepthMap, EvalError> {
    let (size, values) = grey16(path)?;
    Ok(DepthMap { size, depth: values.iter().map(|&v| known(v, f64::from(v) / 5000.0, -1.0)).collect() })
}

fn known(stored: u16, metres: f64, unknown: f32) -> f32 {
    if stored == 0 { unknown } else { metres as f32 }
}

/// Reads Sintel's depth.
///
/// # Errors
/// [`EvalError::Read`], [`EvalError::Format`].
pub fn read_sintel(path: &Path) -> Result<DepthMap, EvalError> {
    let bytes = folder::bytes(path)?;
    let wrong = |reason: String| EvalError::format("Sintel depth", reason, path);
    let (words, rest) = bytes.as_chunks::<4>();
    let [tag, width, height, ..] = words else {
        return Err(wrong("it is shorter than its header".into()));
    };
    if f32::from_le_bytes(*tag) != SINTEL_TAG {
        return Err(wrong(format!("it does not begin with {SINTEL_TAG}")));
    }
    let side = |word: &[u8; 4]| usize::try_from(i32::from_le_bytes(*word)).ok().filter(|&side| side > 0);
    let pixels = side(width).zip(side(height)).and_then(|(w, h)| w.checked_mul(h));
    if !rest.is_empty() || pixels != Some(words.len() - 3) {
        return Err(wrong(format!("{} values do not fit the size in its header", words.len() - 3)));
    }
    let size = [side(width).unwrap_or(0), side(height).unwrap_or(0)];
    Ok(DepthMap { size, depth: words[3..].iter().map(|word| f32::from_le_bytes(*word)).collect() })
}

fn read_npy(path: &Path) -> Result<DepthMap, EvalError> {
    let array = npy::read(path)?;
    array.expect(&[None, None], "[H, W]")?;
    Ok(DepthMap { size: [array.shape()[1], array.shape()[0]], depth: array.f32s()? })
}

/// Width, height and values of a 16-bit grey PNG.
fn grey16(path: &Path) -> Result<([usize; 2], Vec<u16>), EvalError> {
    let bytes = folder::bytes(path)?;
    let decoded = ImageReader::with_format(std::io::Cursor::new(bytes), ImageFormat::Png).decode();
    match decoded {
        Ok(DynamicImage::ImageLuma16(grey)) => Ok(([grey.width() as usize, grey.height() as usize], grey.into_raw())),
        Ok(other) => {
            let reason = format!("it has {:?} pixels", other.color());
            Err(EvalError::format("16-bit grey PNG of depth", reason, path))
        }
        Err(error) => Err(EvalError::format("16-bit grey PNG of depth", error.to_string(), path)),
    }
}

/// The predicted depth of a sequence, read a frame at a time.
#[derive(Debug)]
pub struct DepthFrames {
    source: Source,
    /// What each frame is called, where files say it: the name of its file without the extension.
    names: Option<Vec<String>>,
}

#[derive(Debug)]
enum Source {
    Array {
        size: [usize; 2],
        depth: Vec<f32>,
    },
    Npy(Vec<PathBuf>),
    /// With the factor of each.
    Scaled(Vec<(PathBuf, f64)>),
}

/// The layouts that [`DepthFrames::find`] knows, for messages.
pub const LAYOUTS: &str = "NAME.npz with `depth` [S,H,W]; NAME.npy [S,H,W]; a folder NAME with one .npy [H,W] for each frame; \
                           a folder NAME written by omnix with --export npz, mini_npz or depth";

impl DepthFrames {
    /// The depth of the sequence `name` below `root`; none if nothing of that name is there.
    ///
    /// # Errors
    /// [`EvalError::NoSequences`] for a folder without depth; as the files have them.
    pub fn find(root: &Path, name: &str) -> Result<Option<Self>, EvalError> {
        let inside = root.join(name);
        if inside.is_dir() {
            return Self::of_folder(&inside).map(Some);
        }
        for extension in ["npz", "npy"] {
            let file = root.join(format!("{name}.{extension}"));
            if file.is_file() {
                return Self::of_file(&file).map(Some);
            }
        }
        Ok(None)
    }

    fn of_folder(dir: &Path) -> Result<Self, EvalError> {
        for file in ["exports/npz/results.npz", "exports/mini_npz/results.npz"] {
            if dir.join(file).is_file() {
                return Self::of_file(&dir.join(file));
            }
        }
        let sidecar = dir.join("depth/depth.json");
        if sidecar.is_file() {
            return of_run(&sidecar);
        }
        let files = folder::files(dir, "npy")?;
        if files.is_empty() {
            return Err(EvalError::NoSequences { layout: LAYOUTS, path: dir.to_owned() });
        }
        let names = Some(files.iter().map(|path| folder::stem(path)).collect());
        Ok(Self { source: Source::Npy(files), names })
    }

    fn of_file(path: &Path) -> Result<Self, EvalError> {
        let is_npy = path.extension().is_some_and(|e| e == "npy");
        let array = if is_npy { npy::read(path)? } else { Archive::open(path)?.array("depth")? };
        array.expect(&[None, None, None], "[S, H, W]")?;
        let size = [array.shape()[2], array.shape()[1]];
        if size.contains(&0) {
            return Err(EvalError::format("depth", "a side of its maps is 0", path));
        }
        Ok(Self { source: Source::Array { size, depth: array.f32s()? }, names: None })
    }

    /// The number of frames.
    #[must_use]
    pub fn len(&self) -> usize {
        match &self.source {
            Source::Array { size, depth } => depth.len() / (size[0] * size[1]),
            Source::Npy(files) => files.len(),
            Source::Scaled(files) => files.len(),
        }
    }

    /// Whether there is no frame.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// For each of the truth's frames, by name, the place of its prediction: by name if every one is there, else in order if the counts agree.
    ///
    /// # Errors
    /// [`EvalError::Counts`].
    pub fn matching(&self, truth: &[String]) -> Result<Vec<usize>, EvalError> {
        let by_name = self.names.as_ref().and_then(|names| {
            truth.iter().map(|name| names.iter().position(|other| other == name)).collect::<Option<Vec<_>>>()
        });
        match by_name {
            Some(places) => Ok(places),
            None => EvalError::expect("frames", self.len(), truth.len()).map(|()| (0..truth.len()).collect()),
        }
    }

    /// Reads a frame.
    ///
    /// # Errors
    /// As the files have them.
    pub fn load(&self, frame: usize) -> Result<DepthMap, EvalError> {
        match &self.source {
            Source::Array { size, depth } => {
                let pixels = size[0] * size[1];
                Ok(DepthMap { size: *size, depth: depth[frame * pixels..(frame + 1) * pixels].to_vec() })
            }
            Source::Npy(files) => read_npy(&files[frame]),
            Source::Scaled(files) => {
                let (path, scale) = &files[frame];
                let (size, values) = grey16(path)?;
                Ok(DepthMap { size, depth: values.iter().map(|&v| known(v, f64::from(v) * scale, f32::NAN)).collect() })
            }
        }
    }
}

/// The depth of a run: the list of pictures with their scales.
fn of_run(sidecar: &Path) -> Result<DepthFrames, EvalError> {
    let wrong = |reason: String| EvalError::format("list of depth pictures", reason, sidecar);
    let text = folder::text(sidecar, "list of depth pictures")?;
    let list: serde_json::Value = serde_json::from_str(&text).map_err(|e| wrong(e.to_string()))?;
    let images = list["images"].as_array().ok_or_else(|| wrong("it has no list `images`".into()))?;
    let out = sidecar.parent().and_then(Path::parent).unwrap_or(Path::new("."));
    let entry = |image: &serde_json::Value| Some((out.join(image["file"].as_str()?), image["scale"].as_f64()?));
    let files: Option<Vec<_>> = images.iter().map(entry).collect();
    let files = files.ok_or_else(|| wrong("an entry has no `file` or `scale`".into()))?;
    Ok(DepthFrames { source: Source::Scaled(files), names: None })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::npy::tests::npy;
    use crate::files::npz;

    #[test]
    fn what_is_no_depth_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        image::GrayImage::new(4, 3).save(&path).unwrap();
        assert!(read_tum(&path).unwrap_err().to_string().contains("L8"));
        let low = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_pixel(2, 2, image::Luma([200]));
        low.save(&path).unwrap();
        assert!(matches!(read_kitti(&path), Err(EvalError::Format { .. })));
        assert_eq!(read_tum(&path).unwrap().depth, [0.04; 4]);
        std::fs::write(&path, b"nothing").unwrap();
        assert!(read_kitti(&path).is_err() && read_sintel(&path).is_err());
        let mut dpt = [SINTEL_TAG.to_le_bytes(), (-1i32).to_le_bytes(), (-1i32).to_le_bytes(), [0; 4]].concat();
        std::fs::write(&path, &dpt).unwrap();
        assert!(read_sintel(&path).is_err());
        dpt[4..12].copy_from_slice(&[1, 0, 0, 0, 1, 0, 0, 0]);
        std::fs::write(&path, &dpt).unwrap();
        assert_eq!(read_sintel(&path).unwrap(), DepthMap { size: [1, 1], depth: vec![0.0] });
    }

    #[test]
    fn predictions_are_found_in_their_layouts_and_matched_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let root = dir.path();
        assert!(DepthFrames::find(root, "a").unwrap().is_none());
        npz::tests::write(&root.join("a.npz"), &[("depth", "|u1", "(2, 1, 3)", vec![1, 2, 3, 4, 5, 6])]);
        let frames = DepthFrames::find(root, "a").unwrap().unwrap();
        assert_eq!(frames.load(1).unwrap(), DepthMap { size: [3, 1], depth: vec![4.0, 5.0, 6.0] });
        assert!(matches!(frames.matching(&["x".into()]), Err(EvalError::Counts { predicted: 2, truth: 1, .. })));

        std::fs::create_dir(root.join("b")).unwrap();
        assert!(matches!(DepthFrames::find(root, "b"), Err(EvalError::NoSequences { .. })));
        for name in ["0001", "0002", "0003"] {
            std::fs::write(root.join(format!("b/{name}.npy")), npy("|u1", "(1, 1)", &[7])).unwrap();
        }
        let frames = DepthFrames::find(root, "b").unwrap().unwrap();
        assert_eq!(frames.matching(&["0003".into(), "0001".into()]).unwrap(), [2, 0]);
        assert_eq!(frames.matching(&["x".into(), "y".into(), "z".into()]).unwrap(), [0, 1, 2]);
        assert!(frames.matching(&["0004".into()]).is_err());
    }

    #[test]
    fn a_run_has_a_scale_for_each_picture() {
        let dir = tempfile::tempdir().unwrap();
        let depth = dir.path().join("s/depth");
        std::fs::create_dir_all(&depth).unwrap();
        let grey = image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_raw(2, 1, vec![0, 1000]).unwrap();
        grey.save(depth.join("000000.png")).unwrap();
        let list = r#"{"images": [{"file": "depth/000000.png", "scale": 0.5}]}"#;
        std::fs::write(depth.join("depth.json"), list).unwrap();
        let map = DepthFrames::find(dir.path(), "s").unwrap().unwrap().load(0).unwrap();
        assert!(map.depth[0].is_nan() && map.depth[1] == 500.0);
        std::fs::write(depth.join("depth.json"), r#"{"images": [{"file": 3}]}"#).unwrap();
        assert!(matches!(DepthFrames::find(dir.path(), "s"), Err(EvalError::Format { .. })));
    }
}
