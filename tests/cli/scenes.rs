//! `omnix scenes`: files, a run that goes on, one failure of each kind.

use std::fs;
use std::path::Path;

use crate::common::{Ran, finish, of_kind, program};

/// Two small scenes of two cameras and two times.
fn scenes(out: &Path, more: &[&str]) -> Ran {
    let small = ["--scenes", "2", "--cameras", "2", "--frames", "2", "--size", "56x28"];
    finish(program().args(["scenes", "--out"]).arg(out).args(small).args(more))
}

#[test]
fn scenes_are_written_once_and_kept() {
    let folder = tempfile::tempdir().unwrap();
    let first = scenes(folder.path(), &["--json", "--shard", "1/2"]).ok().events();
    let written = of_kind(&first, "scene");
    assert_eq!((written.len(), written[0]["index"].as_u64()), (1, Some(1)));
    assert!(folder.path().join("scene_000001/image/cam_01/frame_0001.jpg").is_file());
    let again = scenes(folder.path(), &["--json"]).ok().events();
    let kept: Vec<bool> = of_kind(&again, "scene").iter().map(|scene| scene["kept"] == true).collect();
    assert_eq!(kept, [false, true]);
    assert!(folder.path().join("scenes-0-of-1.json").is_file());
    let other = scenes(folder.path(), &["--seed", "9"]);
    other.fails(3, &["another recipe", "scene_000000"]);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let recipe = folder.path().join("recipe.toml");
    fs::write(&recipe, "movers = [3, 1]").unwrap();
    let recipe = recipe.to_str().unwrap();
    let out = folder.path().join("out");
    scenes(&out, &["--recipe", recipe]).fails(2, &["movers"]);
    scenes(&out, &["--recipe", "/nonexistent.toml"]).fails(3, &["nonexistent.toml"]);
    scenes(&out, &["--assets", folder.path().to_str().unwrap()]).fails(3, &["no JPEG"]);
    assert_eq!(scenes(&out, &["--shard", "2/2"]).code, Some(2));
    let file = folder.path().join("file");
    fs::write(&file, "").unwrap();
    scenes(&file, &[]).fails(6, &["file"]);
}

#[test]
fn labels_that_no_layout_has_are_written_when_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let plain = scenes(folder.path(), &["--shard", "0/2"]).ok();
    assert!(!folder.path().join("scene_000000/normals").exists(), "{}", plain.err);
    // The scenes of another choice of labels are other scenes.
    scenes(folder.path(), &["--shard", "0/2", "--labels", "normals"]).fails(3, &["scene_000000"]);
    let out = folder.path().join("more");
    scenes(&out, &["--shard", "0/2", "--labels", "normals,flow", "--layout", "omnix"]).ok();
    let scene = out.join("scene_000000");
    for file in ["normals/cam_01/frame_0001.npy", "flow/cam_00/frame_0000.npy", "tracks.safetensors"] {
        assert!(scene.join(file).is_file(), "{file}");
    }
    assert_eq!(scenes(&out, &["--labels", "normal"]).code, Some(2));
}
