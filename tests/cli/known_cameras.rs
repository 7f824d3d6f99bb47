//! Cameras that the user knows: read, matched, told how they agree, and in the results.

use std::fs;
use std::path::Path;

use crate::common::{array, folder, json, of_kind, omnix, reconstruct, root};

/// A network of Depth Anything 3 with a camera encoder, of random weights.
fn tiny() -> String {
    root().join("tests/data/goldens/tiny-a").to_str().unwrap().to_owned()
}

/// World-to-camera of camera `i`: on a curve, all looking along z.
fn pose(i: usize) -> [f64; 3] {
    [-0.3 * i as f64, 0.2 * (i * i) as f64, -0.1 * (i % 2) as f64]
}

/// Writes transforms.json for the pictures that [`folder`] makes, with this in front of the frames.
fn transforms(dir: &Path, count: usize, head: &str) -> String {
    let frame = |i: usize| {
        // Camera-to-world with y up and z back: the centre is minus the translation.
        let [x, y, z] = pose(i).map(|v| -v);
        format!(
            r#"{{"file_path":"frames/{i:03}.png","transform_matrix":[[1,0,0,{x}],[0,-1,0,{y}],[0,0,-1,{z}],[0,0,0,1]]}}"#
        )
    };
    let frames = (0..count).map(frame).collect::<Vec<_>>().join(",");
    let path = dir.join("transforms.json");
    fs::write(&path, format!(r#"{{"w":150,"h":90,"fl_x":120,"fl_y":120,{head}"frames":[{frames}]}}"#)).unwrap();
    path.to_str().unwrap().to_owned()
}

#[test]
fn known_cameras_are_those_of_the_results() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 4), dir.path().join("out"));
    let cameras = transforms(dir.path(), 4, "");
    let more = ["--weights", &tiny(), "--cameras", &cameras, "--process-res", "70", "--export", "npz,colmap", "--json"];
    let events = reconstruct(&frames, &out, &more).ok().events();
    let told = &of_kind(&events, "cameras")[0];
    assert!(told["scale"].as_f64().unwrap() > 0.0 && told["turned_degrees"].as_array().unwrap().len() == 2, "{told}");
    let (shape, extrinsics) = array(&out.join("exports/npz/results.npz"), "extrinsics");
    assert_eq!(shape, [4, 3, 4]);
    for (i, matrix) in extrinsics.chunks(12).enumerate() {
        let [x, y, z] = pose(i).map(|v| v as f32);
        assert_eq!(matrix, [1.0, 0.0, 0.0, x, 0.0, 1.0, 0.0, y, 0.0, 0.0, 1.0, z], "{i}");
    }
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["unit_of_length"], "that of the known cameras");
    assert!(manifest["settings"]["cameras"].as_str().unwrap().contains("transforms.json"));
    // What was written is a model that can be given again, at the pictures' own size.
    let model = out.join("exports/colmap/text");
    assert!(fs::read_to_string(model.join("cameras.txt")).unwrap().contains("PINHOLE 150 90 120 120 75 45"));
    let again = dir.path().join("again");
    let more = ["--weights", &tiny(), "--cameras", model.to_str().unwrap(), "--process-res", "70", "--export", "npz"];
    reconstruct(&frames, &again, &more).ok();
    assert_eq!(array(&again.join("exports/npz/results.npz"), "extrinsics").1, extrinsics);
}

#[test]
fn cameras_that_do_not_fit_are_refused_before_any_work() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 4), dir.path().join("out"));
    let run = |cameras: &str, more: &[&str]| {
        reconstruct(
            &frames,
            &out,
            &[&["--weights", &tiny(), "--cameras", cameras, "--process-res", "70"], more].concat(),
        )
    };
    run(&transforms(dir.path(), 3, ""), &[]).fails(3, &["1 of 4", "003.png", "transforms.json"]);
    run(&transforms(dir.path(), 4, r#""is_fisheye":true,"#), &[]).fails(3, &["fisheye"]);
    let bent = transforms(dir.path(), 4, r#""k1":-0.1,"#);
    run(&bent, &["--export", "colmap"]).fails(2, &["colmap", "undistort"]);
    run("nowhere.json", &[]).fails(3, &["nowhere.json"]);
    run(&transforms(dir.path(), 4, ""), &["--frames", "2"]).fails(2, &["at least 3 views"]);
    // A network without a camera encoder.
    omnix(&["reconstruct", frames.to_str().unwrap(), "--out", out.to_str().unwrap(), "--cameras", &bent])
        .fails(2, &["no camera encoder"]);
    assert!(!out.exists() || fs::read_dir(&out).unwrap().count() == 0);
}
