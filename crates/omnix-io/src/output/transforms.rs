//! `transforms`: cameras as nerfstudio and instant-ngp read them (nerfstudio's documentation, "Data conventions"), `transforms.json`.
//!
//! Camera-to-world with OpenGL axes (x right, y up, z back). Each frame has its lens at the size of the picture that it was made of, and that
//! picture's name; the pictures themselves are not copied.

use std::path::PathBuf;

use serde_json::{Value, json};

use super::atomic;
use super::camera::Camera;
use super::format::{FileKind, Format};
use super::frame::{FrameResult, RunSummary, Sink};
use crate::IoError;

const NAME: &str = "transforms.json";

pub(super) const FORMAT: Format = Format {
    name: "transforms",
    needs_cameras: true,
    states_source_lenses: true,
    files: &[FileKind::one(
        NAME,
        "camera-to-world with OpenGL axes, and lenses at the size of the source pictures, corner of the first pixel at 0",
    )],
    disk: |size| size.images.saturating_mul(1000),
    memory: |size| size.images.saturating_mul(4000),
    frames: Some(|dir, _| Ok(Box::new(TransformsSink { path: dir.join(NAME), frames: Vec::new() }))),
    ..Format::NONE
};

struct TransformsSink {
    path: PathBuf,
    frames: Vec<Value>,
}

impl Sink for TransformsSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        let (rotation, centre) = Camera::of(frame, FORMAT.name)?.camera_to_world();
        let missing = || IoError::MissingField { export: FORMAT.name, missing: "intrinsics", index: frame.index };
        let source = frame.source();
        let [fx, fy, cx, cy] = source.pinhole(&frame.intrinsics.ok_or_else(missing)?);
        // OpenGL's y and z point the other way.
        let row = |i: usize| {
            let axes = rotation.row(i);
            json!([axes.x, -axes.y, -axes.z, centre[i]])
        };
        self.frames.push(json!({
            "file_path": source.name, "w": source.size[0], "h": source.size[1], "fl_x": fx, "fl_y": fy, "cx": cx, "cy": cy,
            "time": frame.time_s, "transform_matrix": [row(0), row(1), row(2), [0, 0, 0, 1]],
        }));
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        if self.frames.is_empty() {
            return Ok(Vec::new());
        }
        let all = json!({ "camera_model": "PINHOLE", "frames": self.frames });
        Ok(vec![atomic::write_file(self.path, format!("{all:#}\n").as_bytes())?])
    }
}
