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

use glam::DVec3;
use serde_json::json;

use super::{
    atomic::AtomicFile,
    camera::{Camera, Point, for_each_point},
    format::{Each, FileKind, Format, Points},
    frame::{FrameResult, RunSummary, Sink},
    glb_layout::{camera_colour, frustum, placement, rows},
    glb_motion::write_glb_motion,
    gltf::{LINES, POINTS, Scene, TO_GLTF},
    options::SinkOptions,
    sample::{ConfidenceSample, Reservoir, percentile},
};
use crate::IoError;

const NAME: &str = "scene.glb";
const CONTAINS: &str = "points and cameras in glTF axes of the first image's camera, centred on the points' median; moving points as morph targets";

/// Of a run with motion the moving scene takes the place of the still one, when all of it is known.
pub(super) const FORMAT: Format = Format {
    name: "glb",
    needs_cameras: true,
    by_default: true,
    files: &[
        FileKind { name: NAME, each: Each::StillRun, contains: CONTAINS, points: Points::DepthAndCamera },
        FileKind { name: NAME, each: Each::MovingRun, contains: CONTAINS, points: Points::Network },
    ],
    disk: |size| {
        if size.motion {
            size.paths(size.moving(), 0, 20 + 12 * size.images.min(32))
        } else {
            size.still(1_000_000).saturating_mul(16)
        }
    },
    memory: |size| if size.motion { size.path_memory(8) } else { 0 },
    frames: Some(|dir, options| Ok(Box::new(GlbSink::new(dir, options)))),
    points: Some(|dir, points, options| {
        let written = write_glb_motion(&dir.join(NAME), options.fps, points, &options.glb)?;
        Ok(written.into_iter().collect())
    }),
    ..Format::NONE
};

/// Sizes in a glb file are 32 bits wide, and no viewer shows more.
const MAX_POINTS: usize = 100_000_000;

struct GlbSink {
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
    fn new(dir: &Path, options: &SinkOptions) -> Self {
        // Enough to be left with the wanted number after the threshold, which never drops more than nine in ten.
        let share = (1.0 - f64::from(options.glb_confidence_percentile) / 100.0).clamp(0.1, 1.0);
        let max_points = options.glb_max_points.min(MAX_POINTS);
        let capacity = (max_points as f64 / share).ceil() as usize;
        Self {
            path: dir.join(NAME),
            options: SinkOptions { glb_max_points: max_points, ..options.clone() },
            points: Reservoir::new(capacity, options.seed),
            confidences: ConfidenceSample::new(options.seed),
            views: Vec::new(),
        }
    }
}

impl Sink for GlbSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(FORMAT.name)?;
        let camera = Camera::of(frame, FORMAT.name)?;
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
