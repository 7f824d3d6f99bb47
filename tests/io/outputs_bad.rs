//! Outputs that cannot be written, results that do not fit, and the manifest.

use std::{fs, path::Path};

use omnix_io::{
    Export, FrameChoice, IoError, RunSummary, SinkOptions, open_sinks,
    output::manifest::{Manifest, ManifestFrame, Weights, WrittenFile},
    preprocess::OmnixPreprocess,
    probe, write_manifest,
};
use serde_json::{Map, Value, json};

use crate::{
    common::{Made, pattern, save},
    outputs::run,
};

fn refused(dir: &Path) -> IoError {
    let error = open_sinks(&[Export::Npz], dir, &SinkOptions::default()).err().expect("the folder was accepted");
    assert!(error.to_string().contains("choose another"), "{error}");
    error
}

#[test]
fn folders_that_cannot_be_written() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "x").unwrap();
    assert!(matches!(refused(&file), IoError::OutputFolder { .. }), "a file in the way");
    assert!(matches!(refused(&file.join("below")), IoError::OutputFolder { .. }), "a file as parent");
    #[cfg(target_os = "linux")]
    assert!(matches!(refused(Path::new("/proc/omnix")), IoError::OutputFolder { .. }), "a folder nobody can make");
}

/// Needs a small file system of its own, which only root may mount; elsewhere the unit test on /dev/full stands in.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk() {
    let dir = tempfile::tempdir().unwrap();
    let small = dir.path().join("small");
    fs::create_dir(&small).unwrap();
    let mount = |program: &str, arguments: &[&str]| {
        std::process::Command::new(program).args(arguments).output().is_ok_and(|o| o.status.success())
    };
    let target = small.to_str().unwrap();
    if !mount("mount", &["-t", "tmpfs", "-o", "size=256k", "tmpfs", target]) {
        return;
    }
    let result = std::panic::catch_unwind(|| {
        let made = Made::new(280, 140);
        for export in ["npz", "ply", "depth"] {
            let out = small.join(export);
            let mut sink =
                open_sinks(&Export::parse_list(export).unwrap(), &out, &SinkOptions::default()).unwrap().remove(0);
            let outcome = (0..40).try_for_each(|i| sink.frame(&made.frame(i, 0, i as u32)));
            let error = match outcome {
                Err(error) => error,
                Ok(()) => sink.finish(&RunSummary::default()).expect_err("more bytes than the disk has"),
            };
            assert!(matches!(&error, IoError::DiskFull { .. }), "{export}: {error:?}");
            let left: Vec<_> = walk(&out).into_iter().filter(|f| f.to_string_lossy().contains(".part")).collect();
            assert!(left.is_empty(), "{export} left {left:?}");
            fs::remove_dir_all(&out).unwrap();
        }
    });
    assert!(mount("umount", &[target]), "the small disk stays mounted at {target}");
    if let Err(panic) = result {
        std::panic::resume_unwind(panic);
    }
}

fn walk(dir: &Path) -> Vec<std::path::PathBuf> {
    let Ok(entries) = fs::read_dir(dir) else { return Vec::new() };
    entries
        .flat_map(|e| {
            let path = e.unwrap().path();
            if path.is_dir() { walk(&path) } else { vec![path] }
        })
        .collect()
}

#[test]
fn other_files_stay_and_same_names_are_replaced() {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("mine.txt"), "keep").unwrap();
    fs::write(dir.path().join("points.ply"), "old").unwrap();
    run(dir.path(), "ply", &SinkOptions::default(), &[(0, 0)], false);
    assert_eq!(fs::read(dir.path().join("mine.txt")).unwrap(), b"keep");
    assert!(fs::read(dir.path().join("points.ply")).unwrap().starts_with(b"ply\n"));
}

#[test]
fn results_without_cameras_or_of_wrong_size() {
    let dir = tempfile::tempdir().unwrap();
    let made = Made::new(28, 14);
    for export in [Export::Ply, Export::Glb, Export::Tum] {
        assert!(export.needs_cameras());
        let mut sink = open_sinks(&[export], dir.path(), &SinkOptions::default()).unwrap().remove(0);
        let frame = omnix_io::FrameResult { extrinsics: None, ..made.frame(7, 0, 0) };
        let message = sink.frame(&frame).unwrap_err().to_string();
        assert!(message.contains("extrinsics") && message.contains("image 7"), "{message}");
        let frame = omnix_io::FrameResult { intrinsics: Some([[0.0; 3]; 3]), ..made.frame(7, 0, 0) };
        assert!(sink.frame(&frame).is_err(), "{export}: a camera without focal length");
    }
    let mut sink = open_sinks(&[Export::Npz], dir.path(), &SinkOptions::default()).unwrap().remove(0);
    let short = omnix_io::FrameResult { depth: &made.depth[1..], ..made.frame(0, 0, 0) };
    assert!(matches!(sink.frame(&short), Err(IoError::WrongSize { what: "depth", .. })));
    sink.frame(&made.frame(0, 0, 0)).unwrap();
    let other = Made::new(14, 14);
    assert!(matches!(sink.frame(&other.frame(1, 0, 1)), Err(IoError::WrongSize { .. })));
    let without = omnix_io::FrameResult { confidence: None, ..made.frame(1, 0, 1) };
    assert!(matches!(sink.frame(&without), Err(IoError::MissingField { missing: "conf", .. })));
}

#[test]
fn export_lists() {
    use Export::{Depth, Glb, MiniNpz};
    assert_eq!(Export::parse_list("mini_npz-glb, depth,glb").unwrap(), [MiniNpz, Glb, Depth]);
    let message = Export::parse_list("npz,obj").unwrap_err().to_string();
    assert!(message.contains("\"obj\"") && message.contains("mini_npz"), "{message}");
}

#[test]
fn manifest_states_everything() {
    let dir = tempfile::tempdir().unwrap();
    save(&pattern(40, 30), &dir.path().join("in/a.png"));
    save(&pattern(40, 30), &dir.path().join("in/b.png"));
    let plan = probe(&[dir.path().join("in").to_str().unwrap()], FrameChoice::all()).unwrap();
    let out = dir.path().join("out");
    let files = run(&out, "npz,mini_npz,depth,ply,glb,tum", &SinkOptions::default(), &[(0, 0)], true);
    let manifest = Manifest {
        network: "da3-small".into(),
        weights: Weights { name: "nano".into(), digest: "blake3:00".into(), licence: None, note: None },
        device: json!({ "name": "test" }),
        unit: "network scale (not metric)".into(),
        settings: json!({}),
        windows: Value::Null,
        memory: json!({}),
        timings_s: json!({}),
        versions: Map::from_iter([("wgpu".to_owned(), Value::from("30"))]),
        frames: ManifestFrame::of_plan(&plan, |f| OmnixPreprocess::default().framing(f.width, f.height).unwrap(), 1),
        notes: Vec::new(),
        files: files.into_iter().map(|path| WrittenFile { path, moving: false }).collect(),
        network_points: "ray maps".into(),
        interrupted: true,
    };
    let path = write_manifest(&out, &manifest).unwrap();
    let text = fs::read_to_string(path).unwrap();
    let document: Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&document["interrupted"], &document["images"][0]["done"]), (&json!(true), &json!(true)));
    let size = |width: u32, height: u32| json!([width, height]);
    let image = &document["images"][1];
    assert_eq!((&image["done"], &image["size"]), (&json!(false), &size(504, 280)));
    // 40 x 30 covers 504 x 280 at 504 x 378, of which the middle is kept.
    let crop = json!({ "left": 0, "top": 49, "width": 504, "height": 280 });
    assert_eq!((&image["resized"], &image["crop"]), (&size(504, 378), &crop));
    for file in document["files"].as_array().unwrap() {
        assert!(out.join(file["path"].as_str().unwrap()).is_file(), "{file}");
        assert_ne!(file["contains"], "see the name", "{file}");
        let points = if ["points.ply", "scene.glb"].contains(&file["path"].as_str().unwrap()) {
            json!("depth and camera")
        } else {
            Value::Null
        };
        assert_eq!(file["points_from"], points, "{file}");
    }
}
