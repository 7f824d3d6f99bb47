//! `omnix eval`: published numbers through the command, our own output against itself, and what cannot be evaluated.

use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::common::{Ran, folder, json, omnix, reconstruct, root};

fn goldens() -> PathBuf {
    root().join("tests/data/goldens/eval")
}

fn eval(kind: &str, pred: &Path, truth: &Path, more: &[&str]) -> Ran {
    let (pred, truth) = (pred.to_str().unwrap(), truth.to_str().unwrap());
    omnix(&[&["eval", kind, "--pred", pred, "--truth", truth][..], more].concat())
}

/// The values of a row of means.
#[track_caller]
fn mean<'a>(report: &'a Value, name: &str) -> &'a Value {
    let rows = report["means"].as_array().unwrap();
    &rows.iter().find(|row| row["name"] == name).unwrap_or_else(|| panic!("no {name} in {rows:?}"))["values"]
}

#[test]
fn tapvid3d_gives_the_published_numbers_and_its_files() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("r.json");
    let source = goldens().join("tapvid3d_files/adt");
    let more = ["--scaling", "median", "--scaling", "reproduce2d", "--json", out.to_str().unwrap()];
    let ran = eval("tapvid3d", &source.join("pred"), &source.join("gt"), &more).ok();
    assert!(ran.out.contains("gt: whole sequences, median") && ran.err.contains("r.md"), "{}{}", ran.out, ran.err);
    let want = &json(&goldens().join("tapvid3d_files/expected.json"))["sources"]["adt"]["mean_over_files"];
    let report = json(&out);
    for scaling in ["median", "reproduce_2d"] {
        let got = mean(&report, &format!("gt: whole sequences, {scaling}"));
        for (ours, theirs) in
            [("APD3D", "average_pts_within_thresh"), ("AJ", "average_jaccard"), ("OA", "occlusion_accuracy")]
        {
            let (got, want) = (got[ours].as_f64().unwrap(), want[scaling][theirs].as_f64().unwrap());
            assert!((got - want).abs() < 1e-6, "{scaling} {ours}: {got} {want}");
        }
    }
    assert_eq!((&report["evaluated"], report["skipped"].as_array().unwrap().len()), (&Value::from(3), 0));
    assert!(report["protocol"]["thresholds"].as_str().unwrap().contains("256 pixels"));
    for file in ["r.md", "r-sequences.svg", "r-frames.svg"] {
        assert!(fs::metadata(dir.path().join(file)).unwrap().len() > 500, "{file}");
    }
}

#[test]
fn a_missing_prediction_counts_as_zero_and_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let source = goldens().join("tapvid3d_files/adt");
    for name in ["clip_0.npz", "clip_2.npz"] {
        fs::copy(source.join("pred").join(name), dir.path().join(name)).unwrap();
    }
    let whole = eval("tapvid3d", &source.join("pred"), &source.join("gt"), &["--clips", "whole"]).ok();
    let ran = eval("tapvid3d", dir.path(), &source.join("gt"), &["--clips", "whole"]).ok();
    assert!(
        ran.err.contains("1 count as zero") && ran.out.contains("clip_1 (counts as zero)"),
        "{}{}",
        ran.out,
        ran.err
    );
    let of = |out: &str| out.lines().find(|l| l.starts_with("| gt: whole")).unwrap().to_owned();
    assert_ne!(of(&whole.out), of(&ran.out));
    let names = dir.path().join("names.txt");
    fs::write(&names, "# two that are there, one that is not\nclip_0\nclip_2.npz\nclip_9\n").unwrap();
    let ran = eval("tapvid3d", dir.path(), &source.join("gt"), &["--names", names.to_str().unwrap()]).ok();
    assert!(!ran.out.contains("counts as zero") && ran.out.contains("- clip_9: it is on the list"), "{}", ran.out);
}

#[test]
fn our_own_output_against_itself() {
    let dir = tempfile::tempdir().unwrap();
    let runs = dir.path().join("runs");
    let frames = folder(dir.path(), 4);
    reconstruct(&frames, &runs.join("scene"), &["--export", "tracks,npz,tum", "--all-tracks"]).ok();
    let out = dir.path().join("r.json");
    let run = |kind: &str, more: &[&str]| {
        eval(kind, &runs, &runs, &[more, &["--json", out.to_str().unwrap()]].concat()).ok();
        json(&out)
    };
    let tracks = run("trajectories", &[]);
    let values = mean(&tracks, "all images, ALL, one scale per scene");
    assert_eq!((values["APD3D"].as_f64(), values["EPE"].as_f64()), (Some(1.0), Some(0.0)), "{tracks}");
    let depth = run("depth", &["--set", "plain", "--clips", "whole", "--align", "median", "--align", "metric"]);
    assert_eq!(mean(&depth, "whole sequences, metric")["abs_rel"], 0.0, "{depth}");
    // Four frames in TUM's format, as prediction and as truth. The network's own cameras may stand still, which determines no alignment.
    let poses = "0 0 0 0 0 0 0 1\n1 1 0 0 0 0 0 1\n2 1 1 0 0 0 0 1\n3 0 1 1 0 0 0 1\n";
    for path in ["scene/trajectory.tum", "scene.tum"] {
        assert!(path == "scene.tum" || runs.join(path).is_file());
        fs::write(runs.join(path), poses).unwrap();
    }
    let pose = run("pose", &["--set", "plain"]);
    assert!(pose["means"][0]["values"]["ATE"].as_f64().unwrap() < 1e-9, "{pose}");
}

#[test]
fn what_cannot_be_evaluated_is_said_with_its_code() {
    let dir = tempfile::tempdir().unwrap();
    let source = goldens().join("tapvid3d_files/adt");
    let (pred, truth) = (source.join("pred"), source.join("gt"));
    eval("tapvid3d", &pred, dir.path(), &[]).fails(3, &["no sequence was found", "NPZ archives"]);
    eval("tapvid3d", &pred, &dir.path().join("none"), &[]).fails(3, &["cannot read"]);
    eval("depth", &pred, &truth, &["--set", "kitti"]).fails(3, &["16-bit PNG"]);
    eval("pose", &pred, &truth, &["--set", "tum"]).fails(3, &["rgb.txt"]);
    eval("trajectories", &pred, dir.path(), &[]).fails(3, &["--export tracks"]);
    eval("tapvid3d", &pred, &truth, &["--clips", "contiguous:0"]).fails(2, &["contiguous:0"]);
    eval("depth", &pred, &truth, &[]).fails(2, &["--set"]);
    let file = dir.path().join("file");
    fs::write(&file, "").unwrap();
    let inside = file.join("r.json");
    eval("tapvid3d", &pred, &truth, &["--json", inside.to_str().unwrap()]).fails(6, &["cannot write"]);
    // Clips longer than any sequence leave nothing.
    eval("tapvid3d", &pred, &truth, &["--clips", "contiguous:100"]).fails(3, &["fill no clip", "2 more"]);
}

#[test]
fn a_network_is_judged_beside_trivial_answers() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("n.json");
    let size = ["--size", "56x42", "--images", "2"];
    let made = [&["eval", "network", "--samples", "2", "--json", out.to_str().unwrap()][..], &size].concat();
    let ran = omnix(&made).ok();
    assert!(ran.out.contains("best plane over rows") && ran.out.contains("validation set"), "{}", ran.out);
    let report = json(&out);
    assert_eq!((&report["kind"], &report["evaluated"]), (&Value::from("network"), &Value::from(2)));
    let of = |name: &str, column: &str| mean(&report, name)[column].as_f64();
    assert!(of("constant depth", "AbsRel") >= of("best plane over rows", "AbsRel"));
    assert!(of("nano", "AbsRel").is_some_and(|error| error > 0.0 && error < 2.0), "{report}");
    assert_eq!((of("nothing moves", "displacement"), of("nothing moves", "IoU")), (Some(1.0), Some(0.0)));
    // A scene on disk, whose cameras are those of the truth.
    let scenes = dir.path().join("scenes");
    let more =
        ["--scenes", "1", "--cameras", "1", "--frames", "3", "--size", "56x42", "--layout", "omnix", "--seed", "4"];
    omnix(&[&["scenes", "--out", scenes.to_str().unwrap()][..], &more].concat()).ok();
    let ran = omnix(&[&["eval", "network", "--data", scenes.to_str().unwrap()][..], &size].concat()).ok();
    assert!(ran.out.contains("nothing moves"), "{}", ran.out);
    omnix(&["eval", "network", "--data", dir.path().join("none").to_str().unwrap()]).fails(3, &["none"]);
    omnix(&["eval", "network", "--weights", "no-such"]).fails(3, &["no-such"]);
    omnix(&["eval", "network", "--size", "57x42"]).fails(2, &["14"]);
}

#[test]
fn what_a_network_costs_is_counted_and_measured() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("r.json");
    let more = ["--images", "2,1", "--size", "42x28", "--runs", "1", "--json", out.to_str().unwrap()];
    let ran = omnix(&[&["eval", "efficiency"][..], &more].concat()).ok();
    let report = json(&out);
    let value = |images: &str, name: &str| mean(&report, images)[name].as_f64().unwrap_or_else(|| panic!("no {name}"));
    // Those of the checkpoint's file.
    let info = omnix(&["weights", "info", "nano", "--json"]).ok().out;
    let stated: Value = serde_json::from_str(info.lines().next().unwrap()).unwrap();
    for images in ["1 image(s)", "2 image(s)"] {
        assert_eq!(value(images, "parameters"), stated["parameters"].as_f64().unwrap() / 1e6, "{stated}");
        assert!(0.0 < value(images, "layers") && value(images, "layers") < value(images, "all"), "{}", ran.out);
        assert!(value(images, "planned") > 0.0 && value(images, "run") > 0.0 && value(images, "start") > 0.0);
        #[cfg(target_os = "linux")]
        assert!(value(images, "measured") > 1.0);
    }
    assert!(value("2 image(s)", "layers") > 1.5 * value("1 image(s)", "layers"));
    let ran = omnix(&["eval", "efficiency", "--size", "43x28"]);
    assert_eq!(ran.code, Some(2), "{}", ran.err);
}

/// Two scenes of two cameras and `frames` frames, in the shared layout or the paper's.
fn made(out: &Path, frames: &str, layout: &str) {
    let size = ["--size", "56x42", "--layout", layout, "--seed", "4"];
    let more = [&["--scenes", "1", "--cameras", "2", "--frames", frames][..], &size].concat();
    omnix(&[&["scenes", "--out", out.to_str().unwrap()][..], &more].concat()).ok();
}

#[test]
fn a_network_is_run_over_a_data_set() {
    let dir = tempfile::tempdir().unwrap();
    let (scenes, out) = (dir.path().join("scenes"), dir.path().join("r.json"));
    made(&scenes, "5", "ue");
    let common = ["--data", scenes.to_str().unwrap(), "--size", "56x42", "--json", out.to_str().unwrap()];
    let run = |kind: &str, more: &[&str]| {
        omnix(&[&["eval", kind][..], &common, more].concat()).ok();
        for file in ["r.md", "r-sequences.svg", "r-frames.svg"] {
            assert!(fs::metadata(dir.path().join(file)).unwrap().len() > 500, "{kind}: {file}");
        }
        let report = json(&out);
        let notes = report["notes"].to_string();
        assert!(notes.contains("the network nano") && notes.contains("left out"), "{kind}: {notes}");
        report
    };
    let depth = run("depth", &["--clips", "contiguous:2", "--align", "scale"]);
    let values = mean(&depth, "contiguous clips of 2 frames, scale");
    assert!(values["abs_rel"].as_f64().is_some_and(|error| error > 0.0 && error < 2.0), "{depth}");
    assert_eq!((&depth["evaluated"], &depth["means"][0]["count"]), (&Value::from(2), &Value::from(4)));
    let trajectories = run("trajectories", &["--clips", "contiguous:4", "--set", "ue"]);
    let all = mean(&trajectories, "all images, ALL, one scale per image");
    assert!(all["APD3D"].is_f64() && all["EPE"].as_f64().is_some_and(|error| error > 0.0), "{trajectories}");
    let names = trajectories["sequences"].to_string() + &trajectories["skipped"].to_string();
    assert!(["monocular/", "pairs/", "hybrid/"].iter().all(|input| names.contains(input)), "{names}");
    // The cameras of a network so small may lie on a line: a result, or a reason.
    let ran = omnix(&[&["eval", "pose"][..], &common, &["--clips", "contiguous:4"]].concat());
    assert!(ran.code == Some(0) || ran.err.contains("no alignment"), "{}{}", ran.out, ran.err);
    // Tracks of the benchmark's own files, in clips that their few frames fill.
    let adt = goldens().join("tapvid3d_files/adt/gt");
    let tracks = ["--data", adt.to_str().unwrap(), "--clips", "contiguous:4", "--json", out.to_str().unwrap()];
    omnix(&[&["eval", "tapvid3d"][..], &tracks].concat()).ok();
    assert!(json(&out)["notes"].to_string().contains("predicted visible"));
}

#[test]
fn runs_over_the_videos_of_scenes_are_compared_with_the_scenes() {
    let dir = tempfile::tempdir().unwrap();
    let (scenes, runs, out) = (dir.path().join("scenes"), dir.path().join("runs"), dir.path().join("r.json"));
    made(&scenes, "3", "ue");
    let camera = scenes.join("scene_000000/image/cam_00");
    let more = ["--size", "56x42", "--export", "tracks", "--all-tracks"];
    reconstruct(&camera, &runs.join("scene_000000/cam_00"), &more).ok();
    let ran = eval("trajectories", &runs, &scenes, &["--json", out.to_str().unwrap()]).ok();
    let report = json(&out);
    assert_eq!(
        (&report["evaluated"], report["skipped"].as_array().unwrap().len()),
        (&Value::from(1), 1),
        "{}",
        ran.out
    );
    assert!(report["skipped"][0]["name"] == "scene_000000/cam_01", "{report}");
    assert!(mean(&report, "first image, ALL, one scale per image")["EPE"].as_f64().is_some_and(|e| e > 0.0));
}

#[test]
fn what_cannot_be_run_is_said_with_its_code() {
    let dir = tempfile::tempdir().unwrap();
    let at = |path: &Path| path.to_str().unwrap().to_owned();
    let none = at(&dir.path().join("none"));
    for kind in ["depth", "pose", "trajectories", "tapvid3d"] {
        omnix(&["eval", kind]).fails(2, &["--pred"]);
        omnix(&["eval", kind, "--data", &none]).fails(3, &["none"]);
        omnix(&["eval", kind, "--data", &none, "--pred", &none, "--truth", &none]).fails(2, &["--data"]);
        omnix(&["eval", kind, "--data", &at(dir.path()), "--weights", "no-such"]).fails(3, &["no-such"]);
    }
    omnix(&["eval", "depth", "--data", &at(dir.path())]).fails(3, &["not a scene of a known data set", "nothing"]);
    omnix(&["eval", "depth", "--data", &none, "--set", "plain"]).fails(3, &["none"]);
    omnix(&["eval", "depth", "--data", &none, "--set", "no-set"]).fails(2, &["kitti", "hoi4d"]);
    omnix(&["eval", "depth", "--pred", &none, "--truth", &none, "--set", "ue"]).fails(2, &["--data"]);
    omnix(&["eval", "depth", "--data", &none, "--clips", "whole", "--clips", "uniform:4"]).fails(2, &["once"]);
    omnix(&["eval", "trajectories", "--data", &at(dir.path()), "--inputs", "mono"]).fails(3, &["not a scene"]);
    let scenes = dir.path().join("scenes");
    made(&scenes, "3", "omnix");
    omnix(&["eval", "trajectories", "--data", &at(&scenes), "--inputs", "mono"]).fails(2, &["mono", "hybrid"]);
    omnix(&["eval", "pose", "--data", &at(&scenes), "--set", "ue"]).fails(3, &["no scene of ue, but of shared"]);
    // Three frames fill no clip of the paper's.
    omnix(&["eval", "depth", "--data", &at(&scenes)]).fails(3, &["fill no clip"]);
    let depths = fs::read_dir(scenes.join("scene_000000/depths")).unwrap();
    depths.for_each(|file| fs::remove_file(file.unwrap().path()).unwrap());
    omnix(&["eval", "depth", "--data", &at(&scenes), "--clips", "whole"]).fails(3, &["unpacked as a whole"]);
}
