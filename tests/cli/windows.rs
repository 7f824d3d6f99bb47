//! Films in windows: every image once, joins and parts in the manifest, runs that were killed, and films that have nothing to join.

use std::collections::BTreeMap;
use std::fs;
use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use serde_json::Value;

use crate::common::{Ran, array, folder, json, many, of_kind, omnix, picture, program, reconstruct};

const SMALL: [&str; 4] = ["--size", "84x56", "--window", "8"];
const EXPORTS: [&str; 2] = ["--export", "npz,depth,ply,tum,glb"];

fn windows(input: &Path, out: &Path, more: &[&str]) -> Ran {
    reconstruct(input, out, &[&SMALL[..], &EXPORTS[..], more].concat())
}

/// Every file of a folder and below, from it, but for the manifest, which states times.
fn files(dir: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    fn walk(at: &Path, dir: &Path, found: &mut BTreeMap<PathBuf, Vec<u8>>) {
        for entry in fs::read_dir(at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                walk(&path, dir, found);
            } else if path.file_name().unwrap() != "manifest.json" {
                found.insert(path.strip_prefix(dir).unwrap().to_owned(), fs::read(&path).unwrap());
            }
        }
    }
    let mut found = BTreeMap::new();
    walk(dir, dir, &mut found);
    found
}

/// The parts of a run: folder, and its first and last image.
fn parts(manifest: &Value) -> Vec<(String, [u64; 2])> {
    let range = |v: &Value| [v[0].as_u64().unwrap(), v[1].as_u64().unwrap()];
    let parts = manifest["windows"]["parts"].as_array().unwrap();
    parts.iter().map(|part| (part["folder"].as_str().unwrap().to_owned(), range(&part["images"]))).collect()
}

/// Holds a run of `images` images to what every such run leaves; the numbers of joined and all seams.
fn whole(out: &Path, images: u64) -> (usize, usize) {
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["interrupted"], false);
    assert!(manifest["images"].as_array().unwrap().iter().all(|image| image["done"] == true));
    let mut next = 0;
    let parts = parts(&manifest);
    for (folder, [first, last]) in &parts {
        assert_eq!(*first, next, "parts follow each other");
        next = last + 1;
        let part = out.join(folder);
        let (shape, depth) = array(&part.join("exports/npz/results.npz"), "depth");
        assert_eq!(shape, [last + 1 - first, 56, 84]);
        assert!(depth.iter().all(|z| z.is_finite()));
        for image in *first..=*last {
            assert!(part.join(format!("depth/{image:06}.png")).is_file(), "image {image}");
        }
        let lines = fs::read_to_string(part.join("trajectory.tum")).unwrap();
        assert_eq!(lines.lines().filter(|line| !line.starts_with('#')).count() as u64, last + 1 - first);
    }
    assert_eq!(next, images);
    let pictures = files(out)
        .keys()
        .filter(|name| name.to_string_lossy().contains("depth/") && name.extension().unwrap() == "png")
        .count();
    assert_eq!(pictures as u64, images, "each image once");
    assert!(!out.join("windows").exists(), "what windows said is removed");
    for file in manifest["files"].as_array().unwrap() {
        assert!(out.join(file["path"].as_str().unwrap()).is_file(), "{file}");
        assert_ne!(file["contains"], "see the name", "{file}");
    }
    let joins = manifest["windows"]["joins"].as_array().unwrap();
    for join in joins {
        if join["joined"] == true {
            assert!(
                join["residual"]["median"].as_f64().unwrap() <= 0.1 && join["points"].as_u64().unwrap() >= 32,
                "{join}"
            );
        } else {
            assert!(!join["reason"].as_str().unwrap().is_empty(), "{join}");
        }
    }
    let joined = joins.iter().filter(|join| join["joined"] == true).count();
    assert_eq!(parts.len(), joins.len() - joined + 1);
    (joined, joins.len())
}

#[test]
fn every_image_comes_out_once() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 20), dir.path().join("out"));
    let ran = windows(&frames, &out, &["--overlap", "3", "--json"]).ok();
    let events = ran.events();
    let planned = &of_kind(&events, "plan")[0]["windows"];
    assert_eq!((&planned["images"], &planned["overlap"], &planned["count"]), (&8.into(), &3.into(), &4.into()));
    assert_eq!(of_kind(&events, "window").len(), 4);
    assert_eq!(of_kind(&events, "join").len(), 3);
    let indices: Vec<u64> = of_kind(&events, "frame").iter().map(|e| e["index"].as_u64().unwrap()).collect();
    assert_eq!(indices, (0..20).collect::<Vec<u64>>());
    let (joined, seams) = whole(&out, 20);
    assert_eq!(seams, 3);
    assert!(joined > 0, "{}", ran.out);
    // The first window's world is the film's, so its images are those of a run without the others, but where it is left.
    let alone = dir.path().join("alone");
    let first: Vec<String> = (0..8).map(|k| frames.join(format!("{k:03}.png")).to_str().unwrap().to_owned()).collect();
    let eight = dir.path().join("eight");
    fs::create_dir(&eight).unwrap();
    for path in &first {
        fs::copy(path, eight.join(Path::new(path).file_name().unwrap())).unwrap();
    }
    reconstruct(&eight, &alone, &["--size", "84x56", "--export", "depth"]).ok();
    let manifest = json(&out.join("manifest.json"));
    let part = out.join(&parts(&manifest)[0].0);
    for image in 0..5 {
        let name = format!("depth/{image:06}.png");
        assert_eq!(fs::read(part.join(&name)).unwrap(), fs::read(alone.join(&name)).unwrap(), "{name}");
    }
}

/// Runs until a line of `--json` has all these words, and kills the run by what it cannot catch.
fn killed_at(input: &Path, out: &Path, words: &[&str]) {
    let mut command = program();
    command.arg("reconstruct").arg(input).arg("--out").arg(out).args(SMALL).args(EXPORTS).arg("--json");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.map(Result::unwrap).any(|line| words.iter().all(|word| line.contains(word))), "no {words:?}");
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_killed_run_goes_on_and_leaves_the_same_files() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, unbroken) = (folder(dir.path(), 20), dir.path().join("unbroken"));
    windows(&frames, &unbroken, &[]).ok();
    let expected = files(&unbroken);
    let out = dir.path().join("out");
    // Again and again, further each time: in the first window, after some, between two images of the exports.
    killed_at(&frames, &out, &["\"phase\":\"head\""]);
    killed_at(&frames, &out, &["\"event\":\"window\"", "\"images\":[6,"]);
    killed_at(&frames, &out, &["\"event\":\"window\"", "\"images\":[12,"]);
    assert!(out.join("windows/000001.safetensors").is_file() && !out.join("manifest.json").exists());
    killed_at(&frames, &out, &["\"event\":\"frame\"", "\"index\":9"]);
    let ran = windows(&frames, &out, &["--json"]).ok();
    let events = ran.events();
    assert!(of_kind(&events, "window").iter().all(|window| window["found"] == true), "{}", ran.out);
    let found = files(&out);
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    for (name, bytes) in &expected {
        assert!(&found[name] == bytes, "{} differs", name.display());
    }
    // Other pictures are another film: nothing of the old windows is used.
    killed_at(&frames, &out, &["\"phase\":\"exports\""]);
    for k in 0..20 {
        picture(&frames.join(format!("{k:03}.png")), 150, 90, 5 * k + 1);
    }
    let ran = windows(&frames, &out, &["--json"]).ok();
    assert!(of_kind(&ran.events(), "window").iter().all(|window| window["found"] == false), "{}", ran.out);
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_says_how_it_goes_on() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 20), dir.path().join("out"));
    let mut command = std::process::Command::new("env");
    command.args(["--default-signal=INT"]).arg(program().get_program());
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(SMALL).args(EXPORTS).arg("--json");
    let mut child = command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines().map(Result::unwrap);
    assert!(lines.any(|line| line.contains("\"event\":\"window\"") && line.contains("\"index\":1")));
    let id = child.id().to_string();
    assert!(std::process::Command::new("kill").args(["-INT", &id]).status().unwrap().success());
    lines.for_each(drop);
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("1 of 3 windows") && said.contains("goes on from there"), "{said}");
    assert_eq!(json(&out.join("manifest.json"))["interrupted"], true);
    let ran = windows(&frames, &out, &["--json"]).ok();
    let found = of_kind(&ran.events(), "window").iter().filter(|window| window["found"] == true).count();
    assert_eq!(found, 1);
    whole(&out, 20);
}

#[test]
fn a_cut_is_kept_apart_and_said() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (dir.path().join("frames"), dir.path().join("out"));
    for k in 0..22u32 {
        // Reds, then blues.
        let colour = |x: u32, y: u32| {
            let v = ((x + 3 * k) * 5 + y * 3) as u8 / 2;
            if k < 9 { [255 - v / 4, v, 20] } else { [20, v / 2, 255 - v / 4] }
        };
        let data: Vec<u8> = (0..90).flat_map(|y| (0..150).flat_map(move |x| colour(x, y))).collect();
        fs::create_dir_all(&frames).unwrap();
        image::save_buffer(frames.join(format!("{k:03}.png")), &data, 150, 90, image::ColorType::Rgb8).unwrap();
    }
    let ran = windows(&frames, &out, &[]).ok();
    assert!(ran.err.contains("the film is cut there") && ran.err.contains("parts"), "{}", ran.err);
    whole(&out, 22);
    let manifest = json(&out.join("manifest.json"));
    let cut: Vec<&Value> =
        manifest["windows"]["joins"].as_array().unwrap().iter().filter(|join| join["images"].is_null()).collect();
    assert_eq!(cut.len(), 1, "{}", manifest["windows"]["joins"]);
    assert!(parts(&manifest).iter().any(|(_, [first, _])| *first == 9), "{:?}", parts(&manifest));
    assert!(parts(&manifest).iter().all(|(folder, _)| folder.starts_with("part_")));
}

#[test]
fn points_are_followed_from_window_to_window() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 20), dir.path().join("out"));
    let export = ["--export", "depth,tracks,csv", "--points", "600"];
    reconstruct(&frames, &out, &[&SMALL[..], &export].concat()).ok();
    let manifest = json(&out.join("manifest.json"));
    let (mut over, mut lines) = (0, 0);
    for (folder, [first, last]) in parts(&manifest) {
        let part = out.join(folder);
        for entry in fs::read_dir(part.join("exports/tracks")).unwrap() {
            let (shape, paths) = array(&entry.unwrap().path(), "trajectory");
            let [times, points] = [shape[0] as usize, shape[1] as usize];
            assert_eq!(times as u64, last + 1 - first);
            for point in 0..points {
                let known = (0..times).filter(|t| paths[3 * (t * points + point)..][..3].iter().all(|v| v.is_finite()));
                let known: Vec<usize> = known.collect();
                // Known from some time on until it is lost.
                assert!(known.len() >= 5 && known.windows(2).all(|pair| pair[1] == pair[0] + 1), "{known:?}");
                over += usize::from(known.len() > 8);
                lines += known.len();
            }
        }
        let csv = fs::read_to_string(part.join("tracks.csv")).unwrap();
        assert!(!csv.contains("NaN"));
        lines -= csv.lines().count() - 1;
    }
    assert_eq!(lines, 0, "a line for each known position");
    // The pictures are all the same, so that nothing leaves them.
    assert!(over > 100, "{over} points were followed over a seam");
    assert!(!out.join("windows").exists());
}

#[test]
fn windows_that_make_no_sense_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 3), dir.path().join("out"));
    for (more, words) in [
        (&["--window", "2", "--overlap", "0"][..], &["--overlap 0", "share no images"][..]),
        (&["--window", "1"], &["--window 1", "at least 2"]),
        (&["--window", "2", "--overlap", "2"], &["at most half, 1"]),
        (&["--window", "2", "--export", "depth,html"], &["html", "all images at once"]),
        (&["--window", "2", "--reference", "1", "--export", "depth"], &["--reference"]),
        (&["--window", "2", "--all-tracks", "--export", "tracks"], &["--all-tracks"]),
    ] {
        reconstruct(&frames, &out, more).fails(2, words);
    }
    assert!(!out.exists());
}

#[test]
fn the_memory_of_a_film_is_that_of_a_window() {
    let plan = |images: &str| {
        let export = ["--export", "npz,depth,tum"];
        let ran =
            omnix(&[&["plan", "--images", images, "--json", "--overlap", "3"], &SMALL[..], &export].concat()).ok();
        let plan = of_kind(&ran.events(), "plan")[0].clone();
        (
            plan["peak_bytes"].as_u64().unwrap(),
            plan["process_bytes"].as_u64().unwrap(),
            plan["windows"]["count"].clone(),
        )
    };
    let (short, long) = (plan("60"), plan("300"));
    assert_eq!((short.0, short.1), (long.0, long.1));
    assert_eq!((&short.2, &long.2), (&12.into(), &60.into()));
}

#[test]
fn films_with_little_in_them() {
    let dir = tempfile::tempdir().unwrap();
    // One frame, and a window larger than the film: the same as without windows.
    for count in [1, 3] {
        let name = |what: &str| dir.path().join(format!("{what}{count}"));
        let frames = folder(&name("film"), count);
        let ran = windows(&frames, &name("in"), &[]).ok();
        assert!(ran.err.contains(&format!("holds all {count} image")), "{}", ran.err);
        reconstruct(&frames, &name("without"), &[&SMALL[..2], &EXPORTS[..]].concat()).ok();
        assert!(files(&name("in")) == files(&name("without")));
    }
    // Black frames, and a camera that does not move: every picture the same.
    let black = dir.path().join("black");
    fs::create_dir(&black).unwrap();
    for k in 0..12 {
        image::save_buffer(black.join(format!("{k:02}.png")), &[0; 3 * 150 * 90], 150, 90, image::ColorType::Rgb8)
            .unwrap();
    }
    for (film, name) in [(black, "of black"), (many(dir.path(), 12), "of one picture")] {
        let out = dir.path().join(name);
        windows(&film, &out, &[]).ok();
        let (joined, seams) = whole(&out, 12);
        assert!(seams == 1 && joined <= 1, "{name}");
    }
}

#[test]
fn a_film_that_does_not_fit_goes_in_windows_by_itself() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 60), dir.path().join("out"));
    let least = |images: &str, export: &str| -> u64 {
        let ran =
            omnix(&["plan", "--images", images, "--size", "84x56", "--export", export, "--memory-budget", "1MiB"]);
        ran.fails(5, &["at least"]).err.split("at least ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap()
    };
    let budget = least("12", "masks");
    assert!(budget < least("60", "depth"), "all of it must not fit");
    let budget = format!("{budget}MiB");
    let ran =
        reconstruct(&frames, &out, &["--size", "84x56", "--export", "npz,depth,tum", "--memory-budget", &budget]).ok();
    assert!(ran.err.contains("do not fit the memory at once") && ran.err.contains("windows of"), "{}", ran.err);
    whole(&out, 60);
    // An export that needs all of them is not given up in silence.
    reconstruct(
        &frames,
        &dir.path().join("none"),
        &["--size", "84x56", "--export", "masks", "--memory-budget", &budget],
    )
    .fails(5, &["at least", "would fit"]);
}
