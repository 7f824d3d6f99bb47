//! What most data sets have in common: for every image a picture, an npz archive with its camera, and maps of one name in folders beside.

use std::path::{Path, PathBuf};

use glam::DVec3;
use omnix_io::Picture;

use crate::files::{Archive, expect_folder, files_with, read_exr, read_grey, read_npy, read_rgb, stem};
use crate::rigid::{Pinhole, Rigid};
use crate::scene::{Video, View};
use crate::{DataError, Flag};

/// Pictures that are read.
pub(crate) const PICTURES: &[&str] = &["jpg", "jpeg", "png", "webp", "bmp"];

/// The images of one camera: folders with files of the same names.
#[derive(Debug, Clone)]
pub(crate) struct Stream {
    pub(crate) name: String,
    /// The pictures in the order of their names.
    pub(crate) pictures: Vec<PathBuf>,
    /// Folder of the cameras.
    cameras: PathBuf,
}

impl Stream {
    /// The images in a folder, their cameras in another.
    ///
    /// # Errors
    /// A folder that is missing, or has no picture.
    pub(crate) fn new(name: &str, pictures: PathBuf, cameras: PathBuf) -> Result<Self, DataError> {
        let pictures = expect_folder(pictures)?;
        let list = files_with(&pictures, PICTURES)?;
        if list.is_empty() {
            return Err(DataError::NoPictures { path: pictures });
        }
        Ok(Self { name: name.to_owned(), pictures: list, cameras: expect_folder(cameras)? })
    }

    /// The number at the end of an image's name, or its index where there is none: the moment, where cameras run together.
    pub(crate) fn number(&self, frame: usize) -> u32 {
        let name = stem(&self.pictures[frame]);
        let digits = name.len() - name.trim_end_matches(|c: char| c.is_ascii_digit()).len();
        name[name.len() - digits..].parse().unwrap_or(frame as u32)
    }

    pub(crate) fn video(&self) -> Video {
        Video { name: self.name.clone(), frames: self.pictures.len() }
    }

    /// The picture of an image.
    pub(crate) fn picture(&self, frame: usize) -> Result<Picture, DataError> {
        read_rgb(&self.pictures[frame])
    }

    /// The picture and its camera, whose archive has one of these names for the intrinsics and the pose (camera to world).
    pub(crate) fn view(&self, frame: usize, intrinsics: &[&str], pose: &[&str]) -> Result<View, DataError> {
        let image = self.picture(frame)?;
        let mut archive = Archive::open(&self.beside(frame, &self.cameras, "npz"))?;
        let camera = pinhole(&mut archive, intrinsics, pose)?;
        let moment = frame as u32;
        Ok(View { image, camera, depth: None, moving: None, moment, seconds: None })
    }

    /// The file of this image's name in another folder.
    pub(crate) fn beside(&self, frame: usize, folder: &Path, extension: &str) -> PathBuf {
        folder.join(format!("{}.{extension}", stem(&self.pictures[frame])))
    }
}

/// The camera in an archive: intrinsics 3 x 3 and a camera-to-world pose of 3 x 4 or 4 x 4.
pub(crate) fn pinhole(archive: &mut Archive, intrinsics: &[&str], pose: &[&str]) -> Result<Pinhole, DataError> {
    let k = archive.any(intrinsics)?.expect(&[3, 3])?;
    let pose = archive.any(pose)?;
    let pose = if pose.shape() == [3, 4] { pose } else { pose.expect(&[4, 4])? };
    let rows: [[f64; 4]; 3] = rows(&pose.to_f64());
    let k_values = k.to_f64();
    let fine = k_values.iter().chain(rows.as_flattened()).all(|v| v.is_finite());
    if !fine {
        return Err(pose.wrong("or the intrinsics beside it have a NaN or infinite number"));
    }
    intrinsics_of(&k_values, Rigid::from_rows(rows).inverse()).map_err(|reason| k.wrong(reason))
}

/// The first twelve numbers as three rows.
pub(crate) fn rows(values: &[f64]) -> [[f64; 4]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| values[4 * i + j]))
}

/// The camera of 3 x 3 intrinsics and a world-to-camera pose.
pub(crate) fn intrinsics_of(k: &[f64], w2c: Rigid) -> Result<Pinhole, &'static str> {
    if !(k[0] > 0.0 && k[4] > 0.0) || k[3] != 0.0 || k[6] != 0.0 || k[7] != 0.0 || k[8] != 1.0 {
        return Err("is not fx, skew, cx / 0, fy, cy / 0, 0, 1 with focal lengths above 0");
    }
    Ok(Pinhole { w2c, focal: [k[0], k[4]], principal: [k[2], k[5]], skew: k[1] })
}

/// A depth map in numpy's format, of this width and height. Maps with an axis of one number are read too.
pub(crate) fn npy_depth(path: &Path, [width, height]: [usize; 2]) -> Result<Vec<f32>, DataError> {
    let array = read_npy(path)?;
    map_of(array, [width, height])
}

/// A map of this width and height.
pub(crate) fn map_of(array: crate::files::Array, [width, height]: [usize; 2]) -> Result<Vec<f32>, DataError> {
    let array = match array.shape().len() {
        2 => array.expect(&[height, width])?,
        _ if array.shape().first() == Some(&1) => array.expect(&[1, height, width])?,
        _ => array.expect(&[height, width, 1])?,
    };
    Ok(array.to_f32())
}

/// A depth map in OpenEXR, of this size.
pub(crate) fn exr_depth(path: &Path, expected: [usize; 2]) -> Result<Vec<f32>, DataError> {
    let (found, depth) = read_exr(path)?;
    if found == expected { Ok(depth) } else { Err(DataError::Sizes { expected, found, path: path.to_owned() }) }
}

/// A depth map of 16 bits, of this size, by the number that each level stands for.
pub(crate) fn deep_depth(path: &Path, expected: [usize; 2], depth: impl Fn(u16) -> f32) -> Result<Vec<f32>, DataError> {
    let map = read_grey(path)?;
    if map.size != expected {
        return Err(DataError::Sizes { expected, found: map.size, path: path.to_owned() });
    }
    if !map.deep {
        return Err(DataError::Map { reason: "it has 8 bits where depth has 16".to_owned(), path: path.to_owned() });
    }
    Ok(map.values.into_iter().map(depth).collect())
}

/// A mask of this size: whether each level is above the middle.
pub(crate) fn mask(path: &Path, expected: [usize; 2]) -> Result<Vec<bool>, DataError> {
    let map = read_grey(path)?;
    if map.size != expected {
        return Err(DataError::Sizes { expected, found: map.size, path: path.to_owned() });
    }
    // Masks are written as 0 and 255, or as 0 and 1.
    let most = map.values.iter().copied().max().unwrap_or(0);
    let middle = if most <= 1 {
        0
    } else if map.deep {
        32767
    } else {
        127
    };
    Ok(map.values.into_iter().map(|level| level > middle).collect())
}

/// A moving mask of this size.
pub(crate) fn moving(path: &Path, size: [usize; 2]) -> Result<Vec<Flag>, DataError> {
    Ok(mask(path, size)?.into_iter().map(Flag::from).collect())
}

/// A point of three numbers; unknown where any is not finite.
pub(crate) fn point(values: &[f64], origin: DVec3) -> [f32; 3] {
    let point = DVec3::new(values[0], values[1], values[2]) - origin;
    if point.is_finite() { point.as_vec3().to_array() } else { [f32::NAN; 3] }
}

/// Whether an image shows a point of the world: its depth there is the point's own, up to `within` of its unit. Where no depth is known,
/// nor is this.
pub(crate) fn shows(view: &View, point: DVec3, within: f64) -> Flag {
    let seen = view.camera.w2c.apply(point);
    let [u, v] = view.camera.project(seen);
    let [width, height] = view.size();
    if !seen.is_finite() {
        return Flag::Unknown;
    }
    if !(seen.z > 0.0 && u >= 0.0 && v >= 0.0 && u < width as f64 && v < height as f64) {
        return Flag::No;
    }
    let depth = view.depth.as_ref().map_or(f32::NAN, |depth| depth[v as usize * width + u as usize]);
    if depth.is_finite() { Flag::from((f64::from(depth) - seen.z).abs() <= within) } else { Flag::Unknown }
}
