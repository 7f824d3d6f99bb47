//! `omnix data check` on scenes written in the shared layout: a right one, and one whose cameras have a flipped axis.

use std::path::Path;

use omnix::Camera;
use omnix_data::{Motion, Sample, SampleParts, Time, Unit, sets};

use crate::common::{of_kind, omnix};

const SIZE: [u32; 2] = [56, 42];

/// Four views of the curved wall z = 6 + 0.3 x + 0.2 y + 0.6 sin 1.3 x · cos 0.9 y from moving cameras; `flip` turns the camera's y axis
/// up. (Of a flat one other cameras explain the depth as well.)
fn wall(flip: bool) -> Sample {
    let sign = if flip { -1.0 } else { 1.0f32 };
    let mut parts = SampleParts {
        size: SIZE,
        images: vec![90; 4 * (SIZE[0] * SIZE[1] * 3) as usize],
        times: (0..4).map(|k| Time { video: 0, frame: k, moment: k, seconds: None }).collect(),
        cameras: Vec::new(),
        depth: Some(Vec::new()),
        moving: None,
        motion: Motion::Unknown,
        unit: Unit::Metre,
    };
    for k in 0..4 {
        let centre = [0.5, -0.8, 0.3].map(|v| v * k as f32);
        for pixel in 0..SIZE[0] * SIZE[1] {
            let [u, v] = [pixel % SIZE[0], pixel / SIZE[0]].map(|v| v as f32 + 0.5);
            let (x, y) = ((u - 28.0) / 50.0, (v - 21.0) / 50.0);
            // Where the ray meets the wall, between in front of it and behind it.
            let behind = |depth: f32| {
                let [x, y, z] = [centre[0] + depth * x, centre[1] + depth * y, centre[2] + depth];
                z > 6.0 + 0.3 * x + 0.2 * y + 0.6 * (1.3 * x).sin() * (0.9 * y).cos()
            };
            let (mut near, mut far) = (1.0, 30.0);
            for _ in 0..40 {
                let middle = 0.5 * (near + far);
                if behind(middle) { far = middle } else { near = middle }
            }
            parts.depth.as_mut().unwrap().push(near);
        }
        let [x, y, z] = centre.map(|c| -c);
        let extrinsics = [[1.0, 0.0, 0.0, x], [0.0, sign, 0.0, sign * y], [0.0, 0.0, 1.0, z]];
        let intrinsics = [[50.0, 0.0, 28.0], [0.0, 50.0, 21.0], [0.0, 0.0, 1.0]];
        parts.cameras.push(Camera { extrinsics, intrinsics });
    }
    Sample::new(parts).unwrap()
}

fn check(folder: &Path, more: &[&str]) -> crate::common::Ran {
    omnix(&[&["data", "check", folder.to_str().unwrap()][..], more].concat())
}

#[test]
fn a_right_scene_passes_and_is_drawn() {
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("set/a");
    sets::shared::write(&wall(false), &scene, &[]).unwrap();
    let sheets = dir.path().join("sheets");
    let ran = check(&dir.path().join("set"), &["--sheets", sheets.to_str().unwrap()]).ok();
    assert!(ran.out.contains("shared") && ran.out.contains("warp"), "{}", ran.out);
    assert!(ran.err.contains("1 of 1 scene(s) without a problem"), "{}", ran.err);
    assert!(image::open(sheets.join("00000.png")).is_ok() && sheets.join("index.html").is_file());
    assert!(image::open(sheets.join("overview.png")).is_ok(), "many scenes in one picture");
}

#[test]
fn a_flipped_axis_is_named() {
    let dir = tempfile::tempdir().unwrap();
    sets::shared::write(&wall(false), &dir.path().join("a"), &[]).unwrap();
    sets::shared::write(&wall(true), &dir.path().join("b"), &[]).unwrap();
    let ran = check(dir.path(), &["--json"]);
    assert_eq!(ran.code, Some(3), "{}{}", ran.out, ran.err);
    let events = ran.events();
    let scenes = of_kind(&events, "scene");
    assert_eq!(scenes[0]["problems"].as_array().unwrap().len(), 0);
    let kinds: Vec<_> = scenes[1]["problems"].as_array().unwrap().iter().map(|p| p["kind"].as_str().unwrap()).collect();
    assert!(kinds.contains(&"flipped_axis") && kinds.contains(&"mirrored_rotation"), "{kinds:?}");
    let total = of_kind(&events, "check")[0].clone();
    assert_eq!((total["good"].as_u64(), total["wrong"].as_u64()), (Some(1), Some(1)));
    check(dir.path(), &[]).fails(3, &["1 scene(s)"]);
}

#[test]
fn bad_input_is_named() {
    let dir = tempfile::tempdir().unwrap();
    check(dir.path(), &[]).fails(3, &["not a scene of a known data set", "nothing"]);
    check(&dir.path().join("none"), &[]).fails(3, &["not there"]);
    check(dir.path(), &["--set", "kitti"]).fails(2, &["kitti", "droid"]);
    sets::shared::write(&wall(false), &dir.path().join("a"), &[]).unwrap();
    std::fs::remove_file(dir.path().join("a/depths/00002.exr")).unwrap();
    check(dir.path(), &[]).fails(3, &["00002.exr"]);
}
