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
use serde_json::json;

use super::{
    Export, FrameResult, RunSummary, Sink, SinkOptions,
    atomic::AtomicFile,
    camera::{Camera, Point, for_each_point},
    colour,
    gltf::{LINES, POINTS, Scene, TO_GLTF},
    sample::{ConfidenceSample, Reservoir, percentile},
};
use crate::IoError;

/// Sizes in a glb file are 32 bits wide, and no viewer shows more.
const MAX_POINTS: usize = 100_000_000;

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
        let (median, distance) = placement(&positions);
        positions.iter_mut().for_each(|p| *p -= median);

        let mut scene = Scene::default();
        let colours: Vec<[u8; 3]> = points.iter().map(|p| p.colour).collect();
        scene.add("points", POINTS, &positions, &colours, &[]);
        if self.options.show_cameras {
            let (lines, colours) = camera_lines(&self.views, distance, |world| in_first(world) - median);
            scene.add("cameras", LINES, &lines, &colours, &[]);
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

/// The points' median, and how far before their centres cameras are drawn: 0.03 times the diagonal of the 5..95 % box.
pub(super) fn placement(positions: &[DVec3]) -> (DVec3, f64) {
    let axes = sorted_axes(positions);
    let at = |p: f32| DVec3::from_array(std::array::from_fn(|a| percentile(&axes[a], p).map_or(0.0, f64::from)));
    let diagonal = (at(95.0) - at(5.0)).length();
    // A single point or none has no box; the cameras must not vanish with it.
    (at(50.0), if diagonal > 0.0 { 0.03 * diagonal } else { 0.03 })
}

pub(super) fn rows(camera: Camera) -> [[f64; 4]; 3] {
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
        ends.extend(frustum(view.camera, (view.width, view.height), distance).map(|p| place(view.camera.to_world(p))));
        colours.extend([camera_colour(i, views.len()); 16]);
    }
    (ends, colours)
}

/// Ends of eight segments in camera axes (OpenCV): the centre to the picture's corner pixels at a distance, and their rectangle.
pub(super) fn frustum(camera: Camera, (width, height): (u32, u32), distance: f64) -> [DVec3; 16] {
    let (right, bottom) = (f64::from(width) - 1.0, f64::from(height) - 1.0);
    let corners = [(0.0, 0.0), (right, 0.0), (right, bottom), (0.0, bottom)].map(|(u, v)| camera.ray(u, v) * distance);
    std::array::from_fn(|i| match i % 4 {
        0 => DVec3::ZERO,
        3 => corners[(i / 4 + 1) % 4],
        _ => corners[i / 4],
    })
}

/// The colour of camera `i` of `count`.
pub(super) fn camera_colour(i: usize, count: usize) -> [u8; 3] {
    colour::hsv((i as f64 + 0.5) / count as f64, 0.85, 0.95)
}
