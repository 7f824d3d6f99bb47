//! Bad inputs and outputs: a clear message, the documented exit code, and no work lost.

use std::fs;
use std::process::Command;

use crate::common::{finish, folder, json, of_kind, omnix, picture, program, reconstruct, root, video};

#[test]
fn no_adapter() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 1);
    for args in [vec!["devices"], vec!["reconstruct", frames.to_str().unwrap(), "--out", "unused"]] {
        let mut command = program();
        // Both names: loaders older than 1.3.207 know the second only.
        command.args(args).env("VK_DRIVER_FILES", "/nonexistent.json").env("VK_ICD_FILENAMES", "/nonexistent.json");
        finish(command.current_dir(dir.path())).fails(4, &["no usable device", "tools/setup"]);
    }
    assert!(!dir.path().join("unused").exists(), "nothing is made before a device is found");
}

#[test]
fn no_such_device() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 1);
    let ran = reconstruct(&frames, &dir.path().join("out"), &["--device", "voodoo"]);
    ran.fails(4, &["voodoo", "0:"]);
}

#[test]
fn not_an_image() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("photo.jpg");
    fs::write(&file, "this is text").unwrap();
    reconstruct(&file, &dir.path().join("out"), &[]).fails(3, &["not a picture", "text", "photo.jpg"]);
}

#[test]
fn an_image_cut_off_in_the_middle() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 3);
    let (file, out) = (frames.join("001.png"), dir.path().join("out"));
    let bytes = fs::read(&file).unwrap();
    fs::write(&file, &bytes[..bytes.len() / 2]).unwrap();
    reconstruct(&frames, &out, &[]).fails(3, &["cut off", "001.png"]);
}

#[test]
fn truncated_video() {
    let dir = tempfile::tempdir().unwrap();
    let clip = dir.path().join("clip.mp4");
    video(&clip);
    let bytes = fs::read(&clip).unwrap();
    fs::write(&clip, &bytes[..bytes.len() / 2]).unwrap();
    reconstruct(&clip, &dir.path().join("out"), &[]).fails(3, &["cut off", "clip.mp4"]);
}

#[test]
fn a_damaged_video_is_used_with_a_note_or_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (clip, out) = (dir.path().join("clip.mkv"), dir.path().join("out"));
    video(&clip);
    let bytes = fs::read(&clip).unwrap();
    fs::write(&clip, &bytes[..bytes.len() * 4 / 5]).unwrap();
    let ran = reconstruct(&clip, &out, &["--export", "npz", "--size", "28x28"]).ok();
    let note = json(&out.join("manifest.json"))["notes"][0].as_str().unwrap().to_owned();
    assert!(note.contains("cut off") && note.contains("of about 10 frames"), "{note}");
    assert!(ran.err.contains(&note), "{}", ran.err);
    reconstruct(&clip, &dir.path().join("none"), &["--strict"]).fails(3, &["cut off", "clip.mkv"]);
    assert!(!dir.path().join("none").exists());
}

#[test]
fn a_picture_too_large_for_the_budget() {
    let dir = tempfile::tempdir().unwrap();
    let bomb = root().join("tests/data/io/huge.webp");
    let out = dir.path().join("out");
    let ran = reconstruct(&bomb, &out, &["--memory-budget", "200MiB", "--size", "28x28"]);
    ran.fails(5, &["13000 x 13000", "200 MiB may be used", "smaller", "--memory-budget"]);
    assert!(!out.join("manifest.json").exists());
    let plan = omnix(&["plan", bomb.to_str().unwrap(), "--size", "28x28", "--json"]).ok();
    let bytes = of_kind(&plan.events(), "plan")[0]["process_bytes"].as_u64().unwrap();
    assert!(bytes > 8 * 13_000 * 13_000, "{bytes}");
}

#[test]
fn pictures_of_two_shapes() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (dir.path().join("frames"), dir.path().join("out"));
    picture(&frames.join("0.png"), 160, 120, 0);
    picture(&frames.join("1.png"), 120, 160, 0);
    let ran = reconstruct(&frames, &out, &["--export", "npz", "--size", "56x42"]).ok();
    assert!(ran.err.contains("1 of 2 image(s) are cropped") && ran.err.contains("1.png loses 43 %"), "{}", ran.err);
    let manifest = json(&out.join("manifest.json"));
    let second = &manifest["images"][1];
    assert_eq!(second["source_size"], serde_json::json!([120, 160]));
    assert_eq!(second["resized"], serde_json::json!([56, 74]));
    assert_eq!(second["crop"], serde_json::json!({ "left": 0, "top": 16, "width": 56, "height": 42 }));
}

#[test]
fn no_frames() {
    let dir = tempfile::tempdir().unwrap();
    let empty = dir.path().join("empty");
    fs::create_dir(&empty).unwrap();
    reconstruct(&empty, &dir.path().join("out"), &[]).fails(3, &["no frames", "empty"]);
    reconstruct(&dir.path().join("absent"), &dir.path().join("out"), &[]).fails(3, &["no such file", "absent"]);
}

#[test]
fn an_image_three_pixels_wide() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("thin.png");
    picture(&file, 3, 200, 0);
    reconstruct(&file, &dir.path().join("out"), &[]).fails(3, &["3 x 200", "14", "thin.png"]);
}

#[test]
fn wrong_usage() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 1);
    let out = dir.path().join("out");
    for more in [&["--export", "usdz"][..], &["--every", "two"], &["--memory-budget", "much"], &["--size", "100x100"]] {
        let ran = reconstruct(&frames, &out, more);
        assert_eq!(ran.code, Some(2), "{more:?}: {}", ran.err);
    }
    reconstruct(&frames, &out, &["--frames", "0"]).fails(2, &["0 frames"]);
    reconstruct(&frames, &out, &["--start", "3", "--end", "2"]).fails(2, &["an end at 2 seconds"]);
    reconstruct(&frames, &out, &["--reference", "7"]).fails(2, &["reference"]);
    assert!(!out.exists());
}

#[test]
fn output_folder_not_writable() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 1);
    // A file in its place: the tests may run as root, whom permissions do not stop.
    let out = dir.path().join("taken");
    fs::write(&out, "here first").unwrap();
    let ran = reconstruct(&frames, &out, &[]).fails(6, &["cannot write", "--out", "taken"]);
    assert!(ran.seconds < 10.0);
    assert_eq!(fs::read_to_string(&out).unwrap(), "here first");
}

#[test]
#[cfg_attr(
    not(mounts),
    ignore = "no file system may be mounted here; tests/io/outputs_bad.rs fills a disk in another way"
)]
fn disk_full() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 3);
    let out = dir.path().join("small");
    fs::create_dir(&out).unwrap();
    let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=128k", "tmpfs"]).arg(&out).output();
    assert!(mount.as_ref().is_ok_and(|m| m.status.success()), "a file system can be mounted: {mount:?}");
    let ran = reconstruct(&frames, &out, &["--export", "npz"]);
    let left: Vec<_> = fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name()).collect();
    let whole = !out.join("exports/npz/results.npz").exists();
    Command::new("umount").arg(&out).status().unwrap();
    // Found before any work; a disk that others fill meanwhile is the sinks' business (tests/io/outputs_bad.rs).
    ran.fails(6, &["the results would take", "128 KiB free", "--out"]);
    assert!(whole, "no half-written file under its final name: {left:?}");
}

#[test]
fn errors_reach_machines_too() {
    let dir = tempfile::tempdir().unwrap();
    let ran = omnix(&["reconstruct", dir.path().to_str().unwrap(), "--out", "unused", "--json"]);
    let ran = ran.fails(3, &["no frames"]);
    let last = ran.events().pop().unwrap();
    assert_eq!(
        (last["event"].as_str(), last["exit_code"].as_u64(), last["kind"].as_str()),
        (Some("error"), Some(3), Some("input"))
    );
}

#[test]
fn results_of_an_earlier_run_survive_a_failed_one() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 1), dir.path().join("out"));
    reconstruct(&frames, &out, &["--export", "npz"]).ok();
    let before = fs::read(out.join("exports/npz/results.npz")).unwrap();
    reconstruct(&frames, &out, &["--export", "npz", "--memory-budget", "1MiB"]).fails(5, &["at least"]);
    assert_eq!(before, fs::read(out.join("exports/npz/results.npz")).unwrap());
    assert_eq!(json(&out.join("manifest.json"))["interrupted"], false);
}
