//! `manifest.json`: what a run was, under which conventions, and what each of its files contains.

use std::path::{Path, PathBuf};

use serde::Serialize;
use serde_json::{Map, Value, json};

use super::atomic;
use crate::{InputPlan, IoError};

/// Layout version of the manifest.
pub const FORMAT: &str = "omnix-manifest-1";

/// The weights of a run.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Weights {
    /// Name, such as "nano" or the folder's.
    pub name: String,
    /// Digest of the file with the name of the hash in front, such as "blake3:...".
    pub digest: String,
    /// What a reader should know of them (training data, licence, limits).
    pub note: Option<String>,
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
    pub source: PathBuf,
    /// Size of the source picture in pixels, width and height.
    pub source_size: [u32; 2],
    /// Size of the exported maps in pixels, width and height.
    pub size: [u32; 2],
    /// Whether its results were finished.
    pub done: bool,
}

impl ManifestFrame {
    /// The frames of a plan, all processed to `size`; the first `done` of them finished.
    #[must_use]
    pub fn of_plan(plan: &InputPlan, size: (u32, u32), done: usize) -> Vec<Self> {
        let frame = |f: &crate::PlannedFrame| Self {
            index: f.index,
            video: f.video,
            frame: f.frame,
            time: f.index,
            source_frame: f.source_frame,
            time_s: f.time_s,
            source: f.path.clone(),
            source_size: [f.width, f.height],
            size: [size.0, size.1],
            done: f.index < done,
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
    /// Every file the sinks returned.
    pub files: Vec<PathBuf>,
    /// Whether the run was stopped before its last image.
    pub interrupted: bool,
}

/// Writes `manifest.json` into `dir`.
///
/// # Errors
/// A full disk or other failure of writing.
pub fn write_manifest(dir: &Path, manifest: &Manifest) -> Result<PathBuf, IoError> {
    let path = dir.join("manifest.json");
    let mut versions = manifest.versions.clone();
    versions.insert("omnix-io".into(), env!("CARGO_PKG_VERSION").into());
    let files: Vec<Value> = manifest
        .files
        .iter()
        .map(|file| {
            let name = relative(dir, file);
            json!({ "contains": contents(&name), "path": name })
        })
        .collect();
    let document = json!({
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
            "pixel_positions": "whole numbers: the centre of the top left pixel is (0, 0)",
            "depth": "along the camera's z axis, not along the ray",
            "tum": "camera-to-world",
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
    let json = serde_json::to_vec_pretty(&document).map_err(|e| IoError::write(&path, e.into()))?;
    atomic::write_file(path, &json)
}

/// The file's name from the output folder, with forward slashes.
fn relative(dir: &Path, file: &Path) -> String {
    let name = file.strip_prefix(dir).unwrap_or(file);
    name.components().map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

/// What a file contains, by its name.
fn contents(name: &str) -> &'static str {
    match name {
        "exports/npz/results.npz" => {
            "image u8 [S,H,W,3], depth f32 [S,H,W] (6 decimals), conf f32 [S,H,W] (2 decimals), extrinsics f32 [S,3,4], intrinsics f32 [S,3,3]"
        }
        "exports/mini_npz/results.npz" => {
            "depth f32 [S,H,W] (8 decimals), conf f32 [S,H,W] (2 decimals), extrinsics f32 [S,3,4], intrinsics f32 [S,3,3]"
        }
        "points.ply" => "points of all images in the world of the extrinsics: x y z, red green blue, confidence",
        "scene.omx4d" => "moving points for web viewers: OMX4D version 1, axes x right, y up, z backward",
        "scene.html" => "a viewer of the moving points, complete in one file: open it in a browser",
        "field.safetensors" => {
            "what paths of points are evaluated from (omnix query); layout in its documentation and header"
        }
        "scene.glb" => "points and cameras in glTF axes of the first image's camera, centred on the points' median",
        "frame_times.csv" => "video, frame and presentation time of every image",
        "depth/depth.json" => "scale and range of every depth picture: 16-bit value * scale = depth, 0 = no depth",
        _ if name.starts_with("depth/") => {
            "depth as 16-bit grey; scale in depth/depth.json and in the text chunk omnix:depth_scale"
        }
        _ if name.starts_with("depth_color/") => {
            "inverse depth, 2nd to 98th percentile, Spectral: near red, far violet, no depth black"
        }
        _ if name.starts_with("exports/tracks/") => {
            "trajectory f32 [T,N,3] (of all pixels [T,H,W,3]) in the world of the extrinsics, pixel i32 [N,2] column and row, confidence, theta, moving, rgb; times, cameras"
        }
        _ if name.starts_with("exports/st4rtrack/") => {
            "f32: pts3d1 image 0's pixels at each time, pts3d2 each image's own, [H,W,6] x y z r g b; conf1, conf2 [H,W]"
        }
        _ if name.starts_with("masks/") => "8-bit grey: 255 where the pixel moves",
        _ if name.starts_with("theta/") => "16-bit grey: motion score, 65535 = 1",
        _ if name.ends_with(".tum") => "timestamp tx ty tz qx qy qz qw of every image, camera-to-world",
        _ => "see the name",
    }
}
