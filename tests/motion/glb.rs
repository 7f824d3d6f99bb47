//! `glb` with moving points: the document and its buffer, by a small reader of our own. (tools/check_outputs.py runs the Khronos validator.)

use std::{fs, path::Path};

use omnix_io::{
    Export,
    output::{GlbMotionOptions, MotionOptions, motion::MovingPoints, write_motion},
};
use serde_json::Value;

use crate::made;

struct Glb {
    document: Value,
    buffer: Vec<u8>,
}

impl Glb {
    fn write(dir: &Path, points: &MovingPoints, glb: GlbMotionOptions) -> Self {
        let options = MotionOptions::default().fps(10.0).glb(glb);
        let files = write_motion(&[Export::Glb], points, dir, &options).unwrap();
        assert_eq!(files, [dir.join("scene.glb")]);
        let bytes = fs::read(&files[0]).unwrap();
        let size = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
        assert_eq!((&bytes[..4], size(8)), (b"glTF".as_slice(), bytes.len()));
        let text = 20 + size(12);
        let document: Value = serde_json::from_slice(&bytes[20..text]).unwrap();
        Self { document, buffer: bytes[text + 8..].to_vec() }
    }

    fn floats(&self, accessor: &Value) -> Vec<f32> {
        let accessor = &self.document["accessors"][accessor.as_u64().unwrap() as usize];
        let view = &self.document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
        let at = |name: &str| view[name].as_u64().unwrap() as usize;
        let bytes = &self.buffer[at("byteOffset")..][..at("byteLength")];
        bytes.chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
    }

    fn node(&self, name: &str) -> Option<(usize, &Value)> {
        self.document["nodes"].as_array().unwrap().iter().enumerate().find(|(_, n)| n["name"] == name)
    }

    fn primitive(&self, name: &str) -> &Value {
        let mesh = self.node(name).unwrap().1["mesh"].as_u64().unwrap() as usize;
        &self.document["meshes"][mesh]["primitives"][0]
    }

    /// Key times and values of an animated property.
    fn channel(&self, name: &str, path: &str) -> (Vec<f32>, Vec<f32>) {
        let (node, _) = self.node(name).unwrap();
        let animation = &self.document["animations"][0];
        let mut channels = animation["channels"].as_array().unwrap().iter();
        let channel = channels.find(|c| c["target"]["node"] == node && c["target"]["path"] == path).unwrap();
        let sampler = &animation["samplers"][channel["sampler"].as_u64().unwrap() as usize];
        assert_eq!(sampler["interpolation"], "LINEAR");
        (self.floats(&sampler["input"]), self.floats(&sampler["output"]))
    }
}

#[test]
fn points_move_as_they_should() {
    let dir = tempfile::tempdir().unwrap();
    let points = made::points(4, 1);
    let glb = Glb::write(dir.path(), &points, GlbMotionOptions::default());
    let moving = glb.primitive("moving points");
    let base = glb.floats(&moving["attributes"]["POSITION"]);
    assert_eq!((base.len(), moving["targets"].as_array().unwrap().len()), (3 * 9 * 4, 3));
    // The first camera turns nothing and glTF's x is OpenCV's: the block slides half a unit a time.
    for (k, target) in moving["targets"].as_array().unwrap().iter().enumerate() {
        for step in glb.floats(&target["POSITION"]).chunks_exact(3) {
            assert!((step[0] - 0.5 * (k + 1) as f32).abs() < 1e-6 && step[1] == 0.0 && step[2] == 0.0, "{k} {step:?}");
        }
    }
    let (keys, weights) = glb.channel("moving points", "weights");
    assert_eq!(keys, [0.0, 0.1, 0.2, 0.3]);
    assert_eq!(weights, [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]);
    let still = glb.primitive("static points");
    assert!(still.get("targets").is_none());
    assert_eq!(glb.floats(&still["attributes"]["POSITION"]).len(), 3 * 39 * 4);
    assert_eq!(glb.document["asset"]["extras"]["moving_points"], 36);
    let size = fs::metadata(dir.path().join("scene.glb")).unwrap().len() as usize;
    let formula = 20 * 156 + (20 + 12 * 3) * 36 + 320 * 4;
    assert!(size > formula && size < formula + 12_000, "{size} is not {formula} and a document");
}

#[test]
fn cameras_go_where_the_images_were_taken() {
    let dir = tempfile::tempdir().unwrap();
    let points = made::points(4, 1);
    let glb = Glb::write(dir.path(), &points, GlbMotionOptions::default());
    let (keys, positions) = glb.channel("camera of video 0", "translation");
    assert_eq!(keys, [0.0, 0.1, 0.3], "image 2 belongs to the other video");
    let extras = &glb.document["asset"]["extras"];
    let median: Vec<f64> =
        extras["median_in_first_camera_gltf_axes"].as_array().unwrap().iter().map(|v| v.as_f64().unwrap()).collect();
    // World to the first camera is a step along y by 0.1.
    for (key, &image) in [0usize, 1, 3].iter().enumerate() {
        let w2c = points.views[image].extrinsics;
        let centre: [f32; 3] = std::array::from_fn(|j| -(0..3).map(|i| w2c[i][j] * w2c[i][3]).sum::<f32>());
        let expected = [centre[0], -(centre[1] + 0.1), -centre[2]];
        for axis in 0..3 {
            let found = positions[3 * key + axis] + median[axis] as f32;
            assert!((found - expected[axis]).abs() < 1e-5, "image {image}: {found} {}", expected[axis]);
        }
    }
    // A turn by 0.1 per image about y in OpenCV axes is one by half that, negated twice over, in quaternions.
    let (_, turns) = glb.channel("camera of video 0", "rotation");
    let length: f32 = turns[8..12].iter().map(|v| v * v).sum();
    assert!((length - 1.0).abs() < 1e-6 && (turns[9].abs() - 0.15f32.sin()).abs() < 1e-6, "{turns:?}");
    let camera = &glb.document["cameras"][0]["perspective"];
    assert!((camera["yfov"].as_f64().unwrap() - 2.0 * (3.0f64 / 8.0).atan()).abs() < 1e-9);
    assert!((camera["aspectRatio"].as_f64().unwrap() - 8.0 / 6.0).abs() < 1e-9);
    assert!(glb.node("camera of video 1").is_some());
}

#[test]
fn limits_and_empty_parts() {
    let dir = tempfile::tempdir().unwrap();
    let glb = GlbMotionOptions::default().max_points(40).max_times(3).show_cameras(false);
    let glb = Glb::write(dir.path(), &made::points(5, 1), glb);
    assert_eq!(glb.document["asset"]["extras"]["key_images"].to_string(), "[0,2,4]");
    assert_eq!(glb.document["asset"]["extras"]["static_points"], 0);
    assert_eq!(glb.document["asset"]["extras"]["moving_points"], 40);
    assert!(glb.node("frusta").is_none() && glb.node("static points").is_none());
    // One image: nothing to animate. Nothing that moves: one primitive.
    let one = Glb::write(dir.path(), &made::points(1, 1), GlbMotionOptions::default());
    assert!(one.document.get("animations").is_none() && one.primitive("moving points").get("targets").is_none());
    let mut still = made::points(3, 1);
    still.moving.fill(false);
    let still = Glb::write(dir.path(), &still, GlbMotionOptions::default().show_cameras(false));
    assert!(still.node("moving points").is_none() && still.document.get("animations").is_none());
}
