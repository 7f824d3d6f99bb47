//! `glb`: `scene.glb`, a glTF 2.0 binary with the points and the cameras (`da3.md` section 15).
//!
//! Points: finite depth > 0 and confidence >= `min(max(1.05, p40), p90)` over all pixels; at most `glb_max_points`, a seeded choice
//! without replacement. Everything is moved by `A = T(-median) * diag(1,-1,-1,1) * w2c_0`: the first image's camera in glTF axes
//! (x right, y up, z backward), centred on the points' median. Each camera is eight line segments: its centre to the corners
//! (0,0), (W-1,0), (W-1,H-1), (0,H-1) at distance 0.03 times the diagonal of the points' 5..95 % box, and their rectangle, in
//! the colour HSV((i+0.5)/S, 0.85, 0.95). Vertex colours are linear light in 16 bits, as glTF wants them.
//!
//! Memory is bounded by `glb_max_points`: percentiles, median and box come from seeded samples (all pixels when they are few).

use std::path::{Path, PathBuf};

use glam::{DMat3, DVec3};
use serde_json::{Value, json};

use super::{
    Export, FrameResult, RunSummary, Sink, SinkOptions,
    atomic::AtomicFile,
    camera::{Camera, Point, for_each_point},
    colour,
    sample::{ConfidenceSample, Reservoir, percentile},
};
use crate::IoError;

const POINTS: u32 = 0;
const LINES: u32 = 1;
const FLOAT: u32 = 5126;
const UNSIGNED_SHORT: u32 = 5123;
const ARRAY_BUFFER: u32 = 34962;

/// Sizes in a glb file are 32 bits wide, and no viewer shows more.
const MAX_POINTS: usize = 100_000_000;

/// Turns OpenCV camera axes into glTF's.
const TO_GLTF: DVec3 = DVec3::new(1.0, -1.0, -1.0);

pub(super) struct GlbSink {
    path: PathBuf,
    options: SinkOptions,
    points: Reservoir<Point>,
    confidences: ConfidenceSample,
    views: Vec<View>,
}

/// What is kept of an image.
struct View {
    camera: Camera,
    width: u32,
    height: u32,
}

impl GlbSink {
    pub(super) fn new(dir: &Path, options: &SinkOptions) -> Self {
        // Enough to be left with the wanted number after the threshold, which never drops more than nine in ten.
        let share = (1.0 - f64::from(options.glb_confidence_percentile) / 100.0).clamp(0.1, 1.0);
        let max_points = options.glb_max_points.min(MAX_POINTS);
        let capacity = (max_points as f64 / share).ceil() as usize;
        Self {
            path: dir.join("scene.glb"),
            options: SinkOptions { glb_max_points: max_points, ..options.clone() },
            points: Reservoir::new(capacity, options.seed),
            confidences: ConfidenceSample::new(options.seed),
            views: Vec::new(),
        }
    }
}

impl Sink for GlbSink {
    fn export(&self) -> Export {
        Export::Glb
    }

    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(Export::Glb)?;
        let camera = Camera::of(frame, Export::Glb)?;
        self.confidences.add(frame);
        for_each_point(frame, &camera, |point| {
            self.points.offer(point);
            Ok(())
        })?;
        self.views.push(View { camera, width: frame.width, height: frame.height });
        Ok(())
    }

    fn finish(self: Box<Self>, summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        let Some(first) = self.views.first().map(|v| v.camera) else {
            return Ok(Vec::new());
        };
        let threshold = threshold(&self.confidences.sorted(), self.options.glb_confidence_percentile);
        let points = self.points.finish(self.options.glb_max_points, |p| threshold.is_none_or(|t| p.confidence >= t));
        let in_first = |world: DVec3| first.to_camera(world) * TO_GLTF;
        let mut positions: Vec<DVec3> =
            points.iter().map(|p| in_first(DVec3::from_array(p.position.map(f64::from)))).collect();
        let axes = sorted_axes(&positions);
        let at = |p: f32| DVec3::from_array(std::array::from_fn(|a| percentile(&axes[a], p).map_or(0.0, f64::from)));
        let (median, diagonal) = (at(50.0), (at(95.0) - at(5.0)).length());
        positions.iter_mut().for_each(|p| *p -= median);
        // A single point or none has no box; the cameras must not vanish with it.
        let distance = if diagonal > 0.0 { 0.03 * diagonal } else { 0.03 };

        let mut scene = Scene::default();
        let colours: Vec<[u8; 3]> = points.iter().map(|p| p.colour).collect();
        scene.add("points", POINTS, &positions, &colours);
        if self.options.show_cameras {
            let (lines, colours) = camera_lines(&self.views, distance, |world| in_first(world) - median);
            scene.add("cameras", LINES, &lines, &colours);
        }
        let extras = json!({
            "axes": "glTF: x right, y up, z backward of the first image's camera; origin at the points' median",
            "unit": self.options.unit,
            "median_in_first_camera_gltf_axes": median.to_array(),
            "first_camera_world_to_camera": rows(first),
            "confidence_threshold": threshold,
            "interrupted": summary.interrupted,
        });
        let mut file = AtomicFile::create(self.path)?;
        scene.write(&mut file, extras)?;
        Ok(vec![file.commit()?])
    }
}

/// `min(max(1.05, p), p90)`; none without confidences.
fn threshold(sorted: &[f32], percent: f32) -> Option<f32> {
    Some(percentile(sorted, percent)?.max(1.05).min(percentile(sorted, 90.0)?))
}

fn rows(camera: Camera) -> [[f64; 4]; 3] {
    let t = camera.to_camera(DVec3::ZERO);
    let r = DMat3::from_cols(DVec3::X, DVec3::Y, DVec3::Z);
    std::array::from_fn(|i| {
        let column = |j: usize| (camera.to_camera(r.col(j)) - t)[i];
        [column(0), column(1), column(2), t[i]]
    })
}

fn sorted_axes(positions: &[DVec3]) -> [Vec<f32>; 3] {
    std::array::from_fn(|axis| {
        let mut values: Vec<f32> = positions.iter().map(|p| p[axis] as f32).collect();
        values.sort_unstable_by(f32::total_cmp);
        values
    })
}

/// Ends and colours of eight segments for each camera, placed by `place` from world positions.
fn camera_lines(views: &[View], distance: f64, place: impl Fn(DVec3) -> DVec3) -> (Vec<DVec3>, Vec<[u8; 3]>) {
    let mut ends = Vec::with_capacity(views.len() * 16);
    let mut colours = Vec::with_capacity(views.len() * 16);
    for (i, view) in views.iter().enumerate() {
        let (right, bottom) = (f64::from(view.width) - 1.0, f64::from(view.height) - 1.0);
        let centre = place(view.camera.to_world(DVec3::ZERO));
        let corners = [(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)]
            .map(|(u, v)| place(view.camera.to_world(view.camera.ray(u, v) * distance)));
        for c in 0..4 {
            ends.extend([centre, corners[c], corners[c], corners[(c + 1) % 4]]);
        }
        let hue = (i as f64 + 0.5) / views.len() as f64;
        colours.extend([colour::hsv(hue, 0.85, 0.95); 16]);
    }
    (ends, colours)
}

/// A glTF document in the making: one mesh and one node for each part, one buffer.
#[derive(Default)]
struct Scene {
    buffer: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    nodes: Vec<Value>,
}

impl Scene {
    /// Adds positions and sRGB colours as one primitive; nothing if there are none, since empty accessors are not valid.
    fn add(&mut self, name: &str, mode: u32, positions: &[DVec3], colours: &[[u8; 3]]) {
        if positions.is_empty() {
            return;
        }
        let positions: Vec<[f32; 3]> = positions.iter().map(|p| p.as_vec3().to_array()).collect();
        let bound = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..3).map(|a| positions.iter().map(|p| p[a]).fold(positions[0][a], pick)).collect()
        };
        let (min, max) = (bound(f32::min), bound(f32::max));
        let bytes = positions.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        let position = self.accessor(
            bytes,
            positions.len(),
            json!({
                "componentType": FLOAT, "type": "VEC3", "min": min, "max": max,
            }),
        );
        let rgba = |c: &[u8; 3]| [colour::linear16(c[0]), colour::linear16(c[1]), colour::linear16(c[2]), u16::MAX];
        let bytes = colours.iter().flat_map(rgba).flat_map(u16::to_le_bytes).collect();
        let colour = self.accessor(
            bytes,
            colours.len(),
            json!({
                "componentType": UNSIGNED_SHORT, "normalized": true, "type": "VEC4",
            }),
        );
        self.nodes.push(json!({ "name": name, "mesh": self.meshes.len() }));
        self.meshes.push(json!({
            "name": name,
            "primitives": [{ "attributes": { "POSITION": position, "COLOR_0": colour }, "mode": mode, "material": 0 }],
        }));
    }

    /// Appends the bytes (a multiple of 4, so that all views stay aligned) and returns the accessor's number.
    fn accessor(&mut self, bytes: Vec<u8>, count: usize, mut accessor: Value) -> usize {
        self.views.push(json!({
            "buffer": 0, "byteOffset": self.buffer.len(), "byteLength": bytes.len(), "target": ARRAY_BUFFER,
        }));
        self.buffer.extend(bytes);
        accessor["bufferView"] = json!(self.views.len() - 1);
        accessor["count"] = json!(count);
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    /// The GLB container: 12-byte header, JSON chunk padded with spaces, binary chunk (glTF 2.0, section 4).
    fn write(self, file: &mut AtomicFile, extras: Value) -> Result<(), IoError> {
        let nodes: Vec<usize> = (0..self.nodes.len()).collect();
        let mut scene = json!({ "name": "scene" });
        let mut document = json!({
            "asset": { "version": "2.0", "generator": concat!("omnix ", env!("CARGO_PKG_VERSION")), "extras": extras },
            "scene": 0,
        });
        if !nodes.is_empty() {
            scene["nodes"] = json!(nodes);
            document["nodes"] = json!(self.nodes);
            document["meshes"] = json!(self.meshes);
            // Points and lines have no normals to be lit by.
            document["materials"] = json!([{
                "name": "unlit",
                "extensions": { "KHR_materials_unlit": {} },
                "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": 1.0 },
            }]);
            document["extensionsUsed"] = json!(["KHR_materials_unlit"]);
            document["accessors"] = json!(self.accessors);
            document["bufferViews"] = json!(self.views);
            document["buffers"] = json!([{ "byteLength": self.buffer.len() }]);
        }
        document["scenes"] = json!([scene]);
        let mut text = document.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let binary = if self.buffer.is_empty() { 0 } else { 8 + self.buffer.len() };
        let total = 12 + 8 + text.len() + binary;
        let size = |n: usize| u32::try_from(n).expect("BUG: MAX_POINTS keeps the file below 4 GiB").to_le_bytes();
        let (total, json_size, binary_size) = (size(total), size(text.len()), size(self.buffer.len()));
        for bytes in [b"glTF".as_slice(), &2u32.to_le_bytes(), &total, &json_size, b"JSON", &text] {
            file.put(bytes)?;
        }
        if binary > 0 {
            for bytes in [binary_size.as_slice(), b"BIN\0", &self.buffer] {
                file.put(bytes)?;
            }
        }
        Ok(())
    }
}
