//! Monocular, metric and nested networks as a user runs them: what they give, in which unit, and what is refused.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{array, finite, folder, json, of_kind, omnix, reconstruct};
use crate::made;

/// A checkpoint that sees sky in some of the pictures that [`folder`] makes, and not in most: the first of some seeds.
fn checkpoint(dir: &Path, config: &Value) -> String {
    let path = dir.join("weights").join(config["model_name"].as_str().unwrap());
    let weights = path.to_str().unwrap().to_owned();
    let frames = folder(dir, 3);
    for seed in 1..20 {
        let tried = dir.join(format!("tried-{seed}"));
        made::write(&path, config, seed);
        let ran = reconstruct(&frames, &tried, &["--weights", &weights, "--process-res", "70", "--export", "npz"]);
        if ran.code == Some(0) {
            let sky = sky(&tried.join("exports/npz/results.npz"));
            let share = sky.iter().filter(|sky| **sky).count() as f64 / sky.len() as f64;
            if (0.1..0.6).contains(&share) {
                return weights;
            }
        }
    }
    panic!("no seed makes some sky");
}

/// Which pixels are sky.
fn sky(npz: &Path) -> Vec<bool> {
    npyz::npz::NpzArchive::open(npz).unwrap().by_name("sky").unwrap().unwrap().into_vec().unwrap()
}

/// The least budget of such a run, in MiB.
fn least(dir: &Path, weights: &str) -> String {
    let more = ["--weights", weights, "--process-res", "70", "--memory-budget", "1MiB"];
    let refused = reconstruct(&dir.join("frames"), &dir.join("refused"), &more);
    let least = refused.err.split("at least ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    format!("{least}MiB")
}

/// Runs three pictures at 70x42.
fn run(dir: &Path, name: &str, weights: &str, more: &[&str]) -> (PathBuf, Vec<Value>) {
    let (frames, out) = (folder(dir, 3), dir.join(name));
    let ran = reconstruct(&frames, &out, &[&["--weights", weights, "--process-res", "70", "--json"], more].concat());
    (out, ran.ok().events())
}

#[test]
fn a_monocular_network_gives_depth_and_sky() {
    let dir = tempfile::tempdir().unwrap();
    let weights = checkpoint(dir.path(), &made::single("made-mono"));
    assert!(omnix(&["weights", "check", &weights]).ok().out.contains("monocular or metric"));
    let (out, _) = run(dir.path(), "out", &weights, &[]);
    let npz = out.join("exports/npz/results.npz");
    let depth = finite(&npz, "depth", &[3, 42, 70]);
    let mut archive = npyz::npz::NpzArchive::open(&npz).unwrap();
    assert!(["extrinsics", "intrinsics", "conf"].iter().all(|name| archive.by_name(name).unwrap().is_none()));
    let sky = sky(&npz);
    let far: Vec<f32> = depth.iter().zip(&sky).filter(|(_, sky)| **sky).map(|(depth, _)| *depth).collect();
    assert!(far.len() > 100 && far.len() < sky.len() * 2 / 3, "{} of {} are sky", far.len(), sky.len());
    assert!(far.iter().all(|depth| *depth == far[0]), "the sky is as far everywhere");
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["unit_of_length"], "network scale (not metric)");
    assert_eq!(manifest["settings"]["cameras"], "none");
    assert!(out.join("depth/000002.png").is_file() && !out.join("scene.glb").exists());
    // The same bits in less memory.
    let (half, _) = run(dir.path(), "half", &weights, &["--memory-budget", &least(dir.path(), &weights)]);
    assert_eq!(array(&half.join("exports/npz/results.npz"), "depth").1, depth);
}

#[test]
fn a_metric_network_measures_where_the_focal_length_is_known() {
    let dir = tempfile::tempdir().unwrap();
    let weights = checkpoint(dir.path(), &made::single("made-metric"));
    let (free, _) = run(dir.path(), "free", &weights, &["--export", "npz"]);
    let unit = |out: &Path| json(&out.join("manifest.json"))["unit_of_length"].as_str().unwrap().to_owned();
    assert!(unit(&free).contains("metres = depth * f / 300"), "{}", unit(&free));
    // Pictures of 150x90 go to 70x42: 120 pixels are 56.
    let frame = |i: usize| {
        format!(
            r#"{{"file_path":"frames/{i:03}.png","transform_matrix":[[1,0,0,{i}],[0,-1,0,0],[0,0,-1,0],[0,0,0,1]]}}"#
        )
    };
    let frames = (0..3).map(frame).collect::<Vec<_>>().join(",");
    let cameras = dir.path().join("transforms.json");
    fs::write(&cameras, format!(r#"{{"w":150,"h":90,"fl_x":120,"fl_y":120,"frames":[{frames}]}}"#)).unwrap();
    let known = ["--cameras", cameras.to_str().unwrap(), "--export", "npz,ply,glb"];
    let (metres, _) = run(dir.path(), "metres", &weights, &known);
    assert_eq!(unit(&metres), "metres");
    let depth = |out: &Path| array(&out.join("exports/npz/results.npz"), "depth").1;
    let ratios = depth(&metres).into_iter().zip(depth(&free)).map(|(metres, free)| metres / free);
    assert!(
        ratios.clone().all(|ratio| (ratio - 56.0 / 300.0).abs() < 1e-3),
        "{:?}",
        ratios.take(5).collect::<Vec<_>>()
    );
    finite(&metres.join("exports/npz/results.npz"), "extrinsics", &[3, 3, 4]);
    assert!(metres.join("points.ply").is_file() && metres.join("scene.glb").is_file());
}

#[test]
fn a_nested_network_gives_metres() {
    let dir = tempfile::tempdir().unwrap();
    let weights = checkpoint(dir.path(), &made::nested());
    assert!(omnix(&["weights", "info", &weights]).ok().out.contains("nested"));
    let (out, events) = run(dir.path(), "out", &weights, &["--export", "npz,tum,glb"]);
    let plan = of_kind(&events, "plan")[0];
    let stages: Vec<&str> = plan["stages"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert_eq!(stages, ["metric backbone", "metric head", "backbone", "head"]);
    assert_eq!(plan["host_bytes"], 3 * 42 * 70 * 4 * 4);
    let scale = of_kind(&events, "metric_scale")[0]["metres"].as_f64().unwrap();
    assert!(scale > 0.0, "{scale}");
    assert_eq!(json(&out.join("manifest.json"))["unit_of_length"], "metres");
    let npz = out.join("exports/npz/results.npz");
    let depth = finite(&npz, "depth", &[3, 42, 70]);
    finite(&npz, "extrinsics", &[3, 3, 4]);
    // As small as the plan goes, and with weights that are converted: the same depth, to the bit.
    let converted = dir.path().join("converted");
    omnix(&["weights", "convert", &weights, converted.to_str().unwrap()]).ok();
    let least = least(dir.path(), &weights);
    let budget = ["--memory-budget", &least, "--export", "npz"];
    let (small, _) = run(dir.path(), "small", converted.to_str().unwrap(), &budget);
    assert_eq!(array(&small.join("exports/npz/results.npz"), "depth").1, depth);
}

#[test]
fn what_needs_cameras_is_refused_by_name() {
    let dir = tempfile::tempdir().unwrap();
    let weights = checkpoint(dir.path(), &made::single("made-mono"));
    let (frames, out) = (folder(dir.path(), 1), dir.path().join("out"));
    let refused = |more: &[&str]| reconstruct(&frames, &out, &[&["--weights", &weights], more].concat());
    refused(&["--export", "npz,ply"])
        .fails(2, &["ply needs cameras", "made-mono", "npz, mini_npz, depth, exr, preview"]);
    refused(&["--export", "tracks"]).fails(2, &["made-mono has no trajectories"]);
    refused(&["--cameras", "rays"]).fails(2, &["ray maps", "any-view networks make rays"]);
    refused(&["--reference", "middle"]).fails(2, &["each image is by itself"]);
    let cameras = dir.path().join("transforms.json");
    let frame = |i: usize| {
        format!(r#"{{"file_path":"frames/{i:03}.png","transform_matrix":[[1,0,0,{i}],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}}"#)
    };
    let frames = (0..3).map(frame).collect::<Vec<_>>().join(",");
    fs::write(&cameras, format!(r#"{{"w":150,"h":90,"fl_x":120,"fl_y":120,"frames":[{frames}]}}"#)).unwrap();
    refused(&["--cameras", cameras.to_str().unwrap()]).fails(2, &["without cameras or a unit"]);
    assert!(!out.exists() || fs::read_dir(&out).unwrap().count() == 0);
}

/// The floats of a binary PLY, a line for each vertex, with the names of its properties.
fn ply(path: &Path) -> (Vec<String>, Vec<Vec<f32>>) {
    let bytes = fs::read(path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    let names: Vec<String> =
        header.lines().filter_map(|l| Some(l.strip_prefix("property float ")?.to_owned())).collect();
    let numbers: Vec<f32> = bytes[end..].chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect();
    let count: usize = header.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().parse().unwrap();
    assert_eq!(numbers.len(), count * names.len(), "{header}");
    let rows = numbers.chunks(names.len()).map(<[f32]>::to_vec).collect();
    (names, rows)
}

#[test]
fn gaussians_are_in_the_layout_of_viewers() {
    let dir = tempfile::tempdir().unwrap();
    let weights = checkpoint(dir.path(), &made::nested());
    let (out, events) = run(dir.path(), "out", &weights, &["--export", "gs_ply,npz"]);
    let (names, gaussians) = ply(&out.join("gs_ply/0000.ply"));
    let expected = "x y z nx ny nz f_dc_0 f_dc_1 f_dc_2 opacity scale_0 scale_1 scale_2 rot_0 rot_1 rot_2 rot_3";
    assert_eq!(names.join(" "), expected);
    // A border of one row and two columns on each side, the farthest tenth and the sky are left out.
    let open = sky(&out.join("exports/npz/results.npz")).iter().filter(|sky| !**sky).count();
    assert!(gaussians.len() < open && gaussians.len() > open / 2, "{} of {open}", gaussians.len());
    for gaussian in &gaussians {
        assert!(gaussian.iter().all(|v| v.is_finite()) && gaussian[3..6] == [0.0; 3]);
        let length: f32 = gaussian[13..].iter().map(|v| v * v).sum();
        assert!((length - 1.0).abs() < 1e-3, "{gaussian:?}");
    }
    // Beside the network's work, which is planned.
    let (_, plain) = run(dir.path(), "plain", &weights, &["--export", "npz"]);
    let flops = |events: &[Value]| of_kind(events, "plan")[0]["flops"].as_u64().unwrap();
    assert!(flops(&events) > flops(&plain));
    let frames = dir.path().join("frames");
    reconstruct(&frames, &dir.path().join("none"), &["--export", "gs_ply"]).fails(2, &["Gaussian head", "da3-giant"]);
}

#[test]
fn features_are_those_of_each_image() {
    let dir = tempfile::tempdir().unwrap();
    let weights = checkpoint(dir.path(), &made::nested());
    let asked = ["--export", "features,npz", "--feature-blocks", "5,1"];
    let npz = |out: &Path| out.join("exports/features/features.npz");
    // Whichever image is first inside the network, images keep their order: before the reference is chosen nothing else differs.
    let (out, _) = run(dir.path(), "middle", &weights, &[&asked[..], &["--reference", "2"]].concat());
    let early = finite(&npz(&out), "block_1", &[3, 3, 5, 32]);
    finite(&npz(&out), "block_5", &[3, 3, 5, 32]);
    let (first, _) = run(dir.path(), "first", &weights, &[&asked[..], &["--reference", "first"]].concat());
    let apart = finite(&npz(&first), "block_1", &[3, 3, 5, 32]);
    let (chosen, _) = run(dir.path(), "chosen", &weights, &asked);
    let chosen = finite(&npz(&chosen), "block_1", &[3, 3, 5, 32]);
    let worst = early.iter().zip(&apart).fold(0.0f32, |worst, (a, b)| worst.max((a - b).abs()));
    assert!(worst < 1e-5, "{worst}");
    let worst = chosen.iter().zip(&apart).fold(0.0f32, |worst, (a, b)| worst.max((a - b).abs()));
    assert!(worst < 1e-5, "{worst}");
    let images: Vec<&[f32]> = early.chunks(early.len() / 3).collect();
    assert!(images[0] != images[2]);
    // The four that the heads see, where none are named.
    let mono = checkpoint(dir.path(), &made::single("made-mono"));
    let (out, _) = run(dir.path(), "mono", &mono, &["--export", "features"]);
    for block in 0..4 {
        finite(&npz(&out), &format!("block_{block}"), &[3, 3, 5, 32]);
    }
    let frames = dir.path().join("frames");
    let refused =
        |more: &[&str]| reconstruct(&frames, &dir.path().join("none"), &[&["--weights", &mono], more].concat());
    refused(&["--export", "features", "--feature-blocks", "9"]).fails(2, &["features of block 9", "blocks 0 to 3"]);
    refused(&["--export", "npz", "--feature-blocks", "1"]).fails(2, &["add it to --export"]);
}
