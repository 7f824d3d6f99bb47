//! The layout that newer trainers share, and what we add to it: a folder per scene.
//!
//! | file | content |
//! |---|---|
//! | `image_names.json` | the names of the images, in their order |
//! | `images/NAME` | pictures of one size |
//! | `cam_from_worlds.npy` | `[N, 3, 4]` world to camera, OpenCV axes |
//! | `intrinsics.npy` | `[N, 3, 3]` in pixels |
//! | `depths/STEM.exr` | z-depth, one channel, 0 is unknown; or `depths/STEM.npy`, `[H, W]`; may be absent |
//! | ours: `omnix.json` | `{"format": "omnix-scene-1", "unit": "metre", "scene" or "mean distance", "times": [{"video", "frame", "moment", "seconds"}]}` |
//! | ours: `moving/STEM.png` | 0 rests, 255 moves, 128 unknown; may be absent |
//! | ours: `tracks.safetensors` | `positions` F32 `[N, P, 3]` (NaN unknown), `visible` U8 `[N, P]` (0 no, 1 yes, 2 unknown), `pixels` F32 `[N, P, 2]` (may be absent) |
//!
//! Without `omnix.json` all images are one video and the unit is one of the scene's own. [`write()`] makes such a folder; its
//! `cam_from_worlds.npy` comes last, so that a folder looks like a scene when it is whole.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use omnix_tensors::{TensorFile, read_text};
use serde::{Deserialize, Serialize};

use crate::files::{read_grey, read_npy, read_rgb, stem};
use crate::posed::{exr_depth, intrinsics_of, npy_depth, rows};
use crate::rigid::{Pinhole, Rigid};
use crate::scene::{Pick, Scene, Video, View};
use crate::set::Set;
use crate::{DataError, Flag, Motion, Time, Tracks, Unit};

mod write;

pub use write::write;
pub(crate) use write::{png, put};

pub(super) const SIGNATURE: &[&str] = &["cam_from_worlds.npy"];
const FORMAT: &str = "omnix-scene-1";
/// A list of names is shorter than this.
const LONGEST: u64 = 64 << 20;

/// `omnix.json`.
#[derive(Debug, Serialize, Deserialize)]
struct About {
    format: String,
    unit: String,
    times: Vec<AboutTime>,
}

/// When an image was taken.
#[derive(Debug, Serialize, Deserialize)]
struct AboutTime {
    video: u32,
    frame: u32,
    moment: u32,
    #[serde(default)]
    seconds: Option<f64>,
}

const UNITS: [(Unit, &str); 3] =
    [(Unit::Metre, "metre"), (Unit::Scene, "scene"), (Unit::MeanDistance, "mean distance")];

#[derive(Debug)]
struct Shared {
    folder: PathBuf,
    names: Vec<String>,
    cameras: Vec<Pinhole>,
    times: Vec<Time>,
    unit: Unit,
    videos: Vec<Video>,
    /// The images of each video.
    images: Vec<Vec<usize>>,
    tracks: Option<Tracks>,
}

pub(super) fn open(folder: &Path) -> Result<Box<dyn Scene>, DataError> {
    let names: Vec<String> = json(&folder.join("image_names.json"))?;
    let count = names.len();
    if count == 0 {
        return Err(DataError::NoPictures { path: folder.join("image_names.json") });
    }
    // Names come from a file: none may lead out of the folder.
    if let Some(name) = names.iter().find(|name| Path::new(name).components().count() != 1 || name.starts_with('.')) {
        let reason = format!("\"{name}\" is not the name of a picture");
        return Err(DataError::Json { reason, path: folder.join("image_names.json") });
    }
    let poses = read_npy(&folder.join("cam_from_worlds.npy"))?.expect(&[count, 3, 4])?;
    let intrinsics = read_npy(&folder.join("intrinsics.npy"))?.expect(&[count, 3, 3])?;
    let (pose_values, k_values) = (poses.to_f64(), intrinsics.to_f64());
    let mut cameras = Vec::with_capacity(count);
    for (pose, k) in pose_values.chunks_exact(12).zip(k_values.chunks_exact(9)) {
        if !pose.iter().chain(k).all(|v| v.is_finite()) {
            return Err(poses.wrong("or the intrinsics beside it have a NaN or infinite number"));
        }
        cameras.push(intrinsics_of(k, Rigid::from_rows(rows(pose))).map_err(|reason| intrinsics.wrong(reason))?);
    }
    let (unit, times) = about(&folder.join("omnix.json"), count)?;
    let mut by_video: BTreeMap<u32, Vec<usize>> = BTreeMap::new();
    for (image, time) in times.iter().enumerate() {
        by_video.entry(time.video).or_default().push(image);
    }
    let videos = by_video.iter().map(|(video, list)| Video { name: format!("video {video}"), frames: list.len() });
    let videos = videos.collect();
    let images = by_video.into_values().collect();
    let tracks = tracks(&folder.join("tracks.safetensors"), count)?;
    Ok(Box::new(Shared { folder: folder.to_owned(), names, cameras, times, unit, videos, images, tracks }))
}

fn json<T: for<'a> Deserialize<'a>>(path: &Path) -> Result<T, DataError> {
    if !path.exists() {
        return Err(DataError::Missing { path: path.to_owned() });
    }
    let text = read_text(path, LONGEST)?;
    serde_json::from_str(&text).map_err(|e| DataError::Json { reason: e.to_string(), path: path.to_owned() })
}

fn about(path: &Path, count: usize) -> Result<(Unit, Vec<Time>), DataError> {
    if !path.exists() {
        let time = |k: usize| Time { video: 0, frame: k as u32, moment: k as u32, seconds: None };
        return Ok((Unit::Scene, (0..count).map(time).collect()));
    }
    let refuse = |reason: String| DataError::Json { reason, path: path.to_owned() };
    let about: About = json(path)?;
    if about.format != FORMAT {
        return Err(refuse(format!("its format is \"{}\" and not \"{FORMAT}\"", about.format)));
    }
    if about.times.len() != count {
        return Err(refuse(format!("it has {} times for {count} images", about.times.len())));
    }
    let unit = UNITS.iter().find(|(_, name)| *name == about.unit).map(|(unit, _)| *unit);
    let unit = unit.ok_or_else(|| refuse(format!("its unit is \"{}\"", about.unit)))?;
    let time = |t: AboutTime| Time { video: t.video, frame: t.frame, moment: t.moment, seconds: t.seconds };
    Ok((unit, about.times.into_iter().map(time).collect()))
}

fn tracks(path: &Path, count: usize) -> Result<Option<Tracks>, DataError> {
    if !path.exists() {
        return Ok(None);
    }
    let file = TensorFile::open(path)?;
    let shape = file.tensor("positions")?.shape.to_vec();
    let wrong = |array: &str, expected: &str, found: Vec<usize>| DataError::ArrayShape {
        array: array.to_owned(),
        expected: expected.to_owned(),
        found,
        path: path.to_owned(),
    };
    let &[images, points, 3] = shape.as_slice() else {
        return Err(wrong("positions", "[images, points, 3]", shape));
    };
    if images != count {
        return Err(wrong("positions", &format!("[{count}, points, 3]"), shape));
    }
    let positions = file.tensor("positions")?.to_f32().as_chunks::<3>().0.to_vec();
    let info = file.info("visible");
    let bytes = file.tensor_bytes("visible").unwrap_or_default();
    if info.is_none_or(|info| info.shape != [count, points]) || bytes.len() != count * points {
        return Err(wrong(
            "visible",
            &format!("[{count}, {points}] of U8"),
            info.map(|i| i.shape.clone()).unwrap_or_default(),
        ));
    }
    let flag = |byte: &u8| [Flag::No, Flag::Yes].get(usize::from(*byte)).copied().unwrap_or_default();
    let visible = bytes.iter().map(flag).collect();
    let pixels = match file.info("pixels") {
        None => None,
        Some(info) if info.shape == [count, points, 2] => {
            Some(file.tensor("pixels")?.to_f32().as_chunks::<2>().0.to_vec())
        }
        Some(info) => return Err(wrong("pixels", &format!("[{count}, {points}, 2]"), info.shape.clone())),
    };
    Ok(Some(Tracks { count: points, positions, visible, pixels }))
}

impl Shared {
    fn beside(&self, image: usize, kind: &str, extension: &str) -> PathBuf {
        self.folder.join(kind).join(format!("{}.{extension}", stem(Path::new(&self.names[image]))))
    }
}

impl Scene for Shared {
    fn set(&self) -> Set {
        Set::Shared
    }

    fn path(&self) -> &Path {
        &self.folder
    }

    fn videos(&self) -> &[Video] {
        &self.videos
    }

    fn unit(&self) -> Unit {
        self.unit
    }

    fn view(&self, video: usize, frame: usize) -> Result<View, DataError> {
        let index = self.images[video][frame];
        let image = read_rgb(&self.folder.join("images").join(&self.names[index]))?;
        let Time { moment, seconds, .. } = self.times[index];
        let mut view = View { image, camera: self.cameras[index], depth: None, moving: None, moment, seconds };
        if self.folder.join("depths").is_dir() {
            let npy = self.beside(index, "depths", "npy");
            let exr = self.beside(index, "depths", "exr");
            let depth = if npy.exists() { npy_depth(&npy, view.size())? } else { exr_depth(&exr, view.size())? };
            view.depth = Some(depth);
        }
        if self.folder.join("moving").is_dir() {
            let path = self.beside(index, "moving", "png");
            let map = read_grey(&path)?;
            if map.size != view.size() || map.deep {
                return Err(DataError::Sizes { expected: view.size(), found: map.size, path });
            }
            let flag = |level: &u16| match level {
                0 => Flag::No,
                255 => Flag::Yes,
                _ => Flag::Unknown,
            };
            view.moving = Some(map.values.iter().map(flag).collect());
        }
        Ok(view)
    }

    fn motion(&self, picks: &[Pick], views: &[View]) -> Result<Motion, DataError> {
        let Some(all) = &self.tracks else {
            return Ok(Motion::Unknown);
        };
        let chosen: Vec<usize> = picks.iter().map(|pick| self.images[pick.video][pick.frame]).collect();
        let unchanged = chosen.iter().zip(views).all(|(image, view)| {
            let own = &self.cameras[*image];
            (own.focal, own.principal) == (view.camera.focal, view.camera.principal)
        });
        fn take<T: Copy>(list: &[T], images: &[usize], count: usize) -> Vec<T> {
            images.iter().flat_map(|image| &list[image * count..(image + 1) * count]).copied().collect()
        }
        Ok(Motion::Tracks(Tracks {
            count: all.count,
            positions: take(&all.positions, &chosen, all.count),
            visible: take(&all.visible, &chosen, all.count),
            // Of the pictures as they lie on the disk.
            pixels: all.pixels.as_ref().filter(|_| unchanged).map(|pixels| take(pixels, &chosen, all.count)),
        }))
    }
}

/// Whether a folder already holds a scene that is whole.
#[must_use]
pub fn is_whole(folder: &Path) -> bool {
    fs::metadata(folder.join(SIGNATURE[0])).is_ok_and(|meta| meta.is_file())
}
