//! `manifest.json`: what a run was, under which conventions, and what each of its files contains.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::atomic;
use super::export::Export;
use super::format::Points;
use crate::{InputPlan, IoError, PlannedFrame, preprocess::Framing};

/// Layout version of the manifest.
pub const FORMAT: &str = "omnix-manifest-1";

/// Name of the file.
pub const MANIFEST: &str = "manifest.json";

/// The weights of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Weights {
    /// Name, such as "nano" or the folder's.
    pub name: String,
    /// Digest of the file with the name of the hash in front, such as "blake3:...".
    pub digest: String,
    /// Their licence, where they are known ones.
    pub licence: Option<String>,
    /// What a reader should know of them (training data, limits).
    pub note: Option<String>,
}

/// A size in pixels, written `[width, height]`, as everywhere in what the program writes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(into = "[u32; 2]")]
pub struct Size {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl From<Size> for [u32; 2] {
    fn from(size: Size) -> Self {
        [size.width, size.height]
    }
}

/// A rectangle of a picture, in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
pub struct Crop {
    /// Pixels left of it.
    pub left: u32,
    /// Pixels above it.
    pub top: u32,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

/// A path as text of a file or an event: what is not Unicode in it is replaced (U+FFFD), for JSON has no other text.
#[must_use]
pub fn path_text(path: &Path) -> String {
    path.to_string_lossy().into_owned()
}

/// A file that a run wrote.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct WrittenFile {
    /// Its path.
    pub path: PathBuf,
    /// Whether trajectories went into it.
    pub moving: bool,
}

/// One image of the run.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ManifestFrame {
    /// Global index.
    pub index: usize,
    /// Video index.
    pub video: u32,
    /// Frame number among the chosen frames of its video.
    pub frame: u32,
    /// Global time: the target time at which points are as in this image.
    pub time: usize,
    /// Frame number in its file or folder.
    pub source_frame: u32,
    /// Presentation time in seconds; null for pictures.
    pub time_s: Option<f64>,
    /// Picture or video file, as reached from the input as given.
    pub source: String,
    /// Size of the source picture, upright and with square pixels.
    pub source_size: Size,
    /// Size that it was resized to.
    pub resized: Size,
    /// What was cut out of that.
    pub crop: Crop,
    /// Size of the exported maps.
    pub size: Size,
    /// Whether its results were finished.
    pub done: bool,
}

impl ManifestFrame {
    /// The frames of a plan, each with how it was resized and cut; the first `done` of them finished.
    #[must_use]
    pub fn of_plan(plan: &InputPlan, framing: impl Fn(&PlannedFrame) -> Framing, done: usize) -> Vec<Self> {
        let frame = |f: &PlannedFrame| {
            let Framing { resized, crop: [left, top, width, height] } = framing(f);
            Self {
                index: f.index,
                video: f.video,
                frame: f.frame,
                time: f.index,
                source_frame: f.source_frame,
                time_s: f.time_s,
                source: path_text(&f.path),
                source_size: Size { width: f.width, height: f.height },
                resized: Size { width: resized.0, height: resized.1 },
                crop: Crop { left, top, width, height },
                size: Size { width, height },
                done: f.index < done,
            }
        };
        plan.frames.iter().map(frame).collect()
    }
}

/// Everything the manifest states that is not fixed by the program.
#[derive(Debug, Clone, PartialEq)]
pub struct Manifest {
    /// Network, such as "da3-small".
    pub network: String,
    /// Its weights.
    pub weights: Weights,
    /// Device by name, backend, driver and class, as the engine describes it.
    pub device: Value,
    /// Unit of length of depth and positions, such as "network scale (not metric)".
    pub unit: String,
    /// Settings of the run: preprocessing, frame choice, budget, exports.
    pub settings: Value,
    /// How a film was cut into windows and joined: its windows, what each join left, its parts. Null where all images were one.
    pub windows: Value,
    /// What the run took: planned on the device, and the process at most where the system says.
    pub memory: Value,
    /// Wall times in seconds by phase.
    pub timings_s: Value,
    /// Further versions (engine, wgpu, driver); the program's own is added.
    pub versions: Map<String, Value>,
    /// The images.
    pub frames: Vec<ManifestFrame>,
    /// Remarks for the user.
    pub notes: Vec<String>,
    /// Every file that was written.
    pub files: Vec<WrittenFile>,
    /// What the network's own world points are made of, where trajectories start.
    pub network_points: String,
    /// Whether the run was stopped before its last image.
    pub interrupted: bool,
}

/// Writes `manifest.json` into `dir`.
///
/// # Errors
/// A full disk or other failure of writing.
pub fn write_manifest(dir: &Path, manifest: &Manifest) -> Result<PathBuf, IoError> {
    let path = dir.join(MANIFEST);
    let mut versions = manifest.versions.clone();
    versions.insert("omnix-io".into(), env!("CARGO_PKG_VERSION").into());
    let files: Vec<Value> = manifest
        .files
        .iter()
        .map(|file| {
            let name = relative(dir, &file.path);
            let kind = Export::kind_of(&name, file.moving);
            let mut entry = json!({ "contains": kind.map_or("see the name", |k| k.contains), "path": name });
            match kind.map(|k| k.points) {
                None | Some(Points::None) => {}
                Some(Points::DepthAndCamera) => entry["points_from"] = json!("depth and camera"),
                Some(Points::Network) => entry["points_from"] = json!(manifest.network_points),
            }
            entry
        })
        .collect();
    let mut document = json!({
        "format": FORMAT,
        "interrupted": manifest.interrupted,
        "network": manifest.network,
        "weights": manifest.weights,
        "device": manifest.device,
        "versions": versions,
        "conventions": {
            "camera_axes": "OpenCV: x right, y down, z forward",
            "extrinsics": "world-to-camera [R|t], 3x4, column vectors: x_camera = R x_world + t",
            "world": "the network's: close to the reference view's camera; scene.glb states its own",
            "intrinsics": "3x3 in pixels of the exported maps",
            "source_pictures": "upright, with square pixels, source_size is resized to `resized`, of which crop is the exported map; with s = resized / source_size the source's intrinsics are fx / s_x, fy / s_y, (cx + left) / s_x, (cy + top) / s_y",
            "pixel_positions": "whole numbers: the centre of the top left pixel is (0, 0)",
            "depth": "along the camera's z axis, not along the ray",
            "points_from": "files that hold points say which: \"depth and camera\" is each pixel's depth, unprojected with the exported camera; \"ray maps\" is the network's own points, origin + depth * direction of each pixel's ray, where trajectories start. A network that does not agree with itself puts the two in different places",
            "tum": "camera-to-world",
            "sizes": "[width, height] in pixels",
            "times": "global index = order of processing = global time, of which there is one an image; (video, frame) counts inputs and chosen frames from 0; time_s in seconds",
        },
        "unit_of_length": manifest.unit,
        "settings": manifest.settings,
        "memory": manifest.memory,
        "timings_s": manifest.timings_s,
        "notes": manifest.notes,
        "files": files,
        "images": manifest.frames,
    });
    if !manifest.windows.is_null() {
        document["windows"] = manifest.windows.clone();
    }
    let json = serde_json::to_vec_pretty(&document).map_err(|e| IoError::write(&path, e.into()))?;
    atomic::write_file(path, &json)
}

/// The file's name from the output folder, with forward slashes.
fn relative(dir: &Path, file: &Path) -> String {
    let name = file.strip_prefix(dir).unwrap_or(file);
    name.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}
