//! What moves, as a user gets it: every export whole, queries equal to what the run wrote, and errors before any work.

use std::fs;
use std::path::Path;

use crate::common::{array, finite, folder, json, of_kind, omnix, picture, reconstruct, root};

const ALL: &str = "npz,glb,tracks,st4rtrack,omx4d,masks,html,field";

fn field(dir: &Path, frames: u32, more: &[&str]) -> std::path::PathBuf {
    let out = dir.join("out");
    reconstruct(&folder(dir, frames), &out, &[&["--size", "84x56"], more].concat()).ok();
    out.join("field.safetensors")
}

fn query(field: &Path, more: &[&str]) -> crate::common::Ran {
    omnix(&[&["query", field.to_str().unwrap()], more].concat())
}

#[test]
fn every_export_is_whole() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("out");
    let ran =
        reconstruct(&folder(dir.path(), 3), &out, &["--size", "84x56", "--export", ALL, "--points", "500", "--json"])
            .ok();
    let events = ran.events();
    let phases: Vec<&str> = of_kind(&events, "progress").iter().filter_map(|e| e["phase"].as_str()).collect();
    for phase in ["backbone", "head", "motion", "sampling", "exports"] {
        assert!(phases.contains(&phase), "no {phase} in {phases:?}");
    }
    let stages = of_kind(&events, "plan")[0]["stages"].as_array().unwrap().len();
    assert_eq!(stages, 5);
    let manifest = json(&out.join("manifest.json"));
    let names: Vec<&str> = manifest["files"].as_array().unwrap().iter().filter_map(|f| f["path"].as_str()).collect();
    for file in manifest["files"].as_array().unwrap() {
        assert!(file["contains"] != "see the name", "{file}");
        assert!(fs::metadata(out.join(file["path"].as_str().unwrap())).unwrap().len() > 0, "{file}");
    }
    for name in ["scene.glb", "scene.html", "scene.omx4d", "field.safetensors", "masks/000002.png", "theta/000000.png"]
    {
        assert_eq!(names.iter().filter(|n| **n == name).count(), 1, "{name} in {names:?}");
    }
    assert_eq!(manifest["settings"]["motion"]["target_times"], 3);
    assert_eq!(manifest["images"][2]["time"], 2);
    // All points together are what was asked for, and none is not finite.
    let points: u64 = (0..3)
        .map(|i| {
            let npz = out.join(format!("exports/tracks/{i:06}.npz"));
            let (shape, numbers) = array(&npz, "trajectory");
            assert!(shape[0] == 3 && numbers.iter().all(|v| v.is_finite()));
            finite(&npz, "theta", &[shape[1]]);
            shape[1]
        })
        .sum();
    assert_eq!(points, 500);
    let html = fs::read_to_string(out.join("scene.html")).unwrap();
    assert!(html.contains("motion has not been learned") && !html.contains("http-equiv=\"refresh\""));
    let theta = image::open(out.join("theta/000001.png")).unwrap();
    assert_eq!((theta.width(), theta.height(), theta.color()), (84, 56, image::ColorType::L16));
}

#[test]
fn a_query_gives_what_the_run_wrote() {
    let dir = tempfile::tempdir().unwrap();
    let field = field(dir.path(), 3, &["--export", "field,tracks", "--all-tracks"]);
    let (shape, dense) = array(&dir.path().join("out/exports/tracks/000001.npz"), "trajectory");
    assert_eq!(shape, [3, 56, 84, 3]);
    let table = dir.path().join("some.npz");
    query(&field, &["--image", "1", "--stride", "9", "--times", "0,2", "--out", table.to_str().unwrap()]).ok();
    let (shape, some) = array(&table, "trajectory");
    let pixels: Vec<usize> = (0..56).step_by(9).flat_map(|y| (0..84).step_by(9).map(move |x| y * 84 + x)).collect();
    assert_eq!(shape, [2, pixels.len() as u64, 3]);
    for (k, time) in [0, 2].into_iter().enumerate() {
        for (i, pixel) in pixels.iter().enumerate() {
            let (got, want) = (3 * (k * pixels.len() + i), 3 * (time * 56 * 84 + pixel));
            assert_eq!(some[got..got + 3], dense[want..want + 3], "time {time}, pixel {pixel}");
        }
    }
    // The same as text and for machines.
    let text = query(&field, &["--image", "1", "--pixel", "9,9", "--times", "2..3"]).ok();
    let want: Vec<String> = dense[3 * (2 * 56 * 84 + 9 * 84 + 9)..][..3].iter().map(f32::to_string).collect();
    assert!(text.out.lines().nth(1).unwrap().contains(&want.join(",")), "{}", text.out);
    let list = dir.path().join("pixels.txt");
    fs::write(&list, "# x,y\n9,9\n\n10, 9\n").unwrap();
    let events = query(&field, &["--image", "1", "--pixels", list.to_str().unwrap(), "--json"]).ok().events();
    assert_eq!((of_kind(&events, "path").len(), events.last().unwrap()["points"].as_u64()), (2, Some(2)));
    let mask = dir.path().join("mask.png");
    image::save_buffer(&mask, &vec![255u8; 84 * 56], 84, 56, image::ColorType::L8).unwrap();
    let csv = dir.path().join("all.csv");
    query(&field, &["--image", "0", "--mask", mask.to_str().unwrap(), "--out", csv.to_str().unwrap()]).ok();
    assert_eq!(fs::read_to_string(&csv).unwrap().lines().count(), 1 + 3 * 84 * 56);
}

#[test]
fn queries_that_cannot_be_answered() {
    let dir = tempfile::tempdir().unwrap();
    let field = field(dir.path(), 2, &["--export", "field", "--field-type", "f16"]);
    query(&field, &["--image", "2", "--stride", "9"]).fails(2, &["images go from 0 to 1"]);
    query(&field, &["--image", "0", "--pixel", "84,0"]).fails(2, &["columns go from 0 to 83"]);
    query(&field, &["--image", "0", "--stride", "9", "--times", "1..3"]).fails(2, &["times go from 0 to 1"]);
    let small = dir.path().join("small.png");
    picture(&small, 30, 30, 0);
    query(&field, &["--image", "0", "--mask", small.to_str().unwrap()]).fails(2, &["30x30", "84x56"]);
    query(&dir.path().join("none.safetensors"), &["--image", "0", "--stride", "9"]).fails(3, &["none.safetensors"]);

    let bytes = fs::read(&field).unwrap();
    let cut = dir.path().join("cut.safetensors");
    fs::write(&cut, &bytes[..bytes.len() - 1000]).unwrap();
    query(&cut, &["--image", "0", "--stride", "9"]).fails(3, &["cut short", "cut.safetensors"]);
    let later = dir.path().join("later.safetensors");
    let at = bytes.windows(13).position(|w| w == b"\"version\":\"2\"").unwrap();
    let mut other = bytes;
    other[at + 11] = b'9';
    fs::write(&later, other).unwrap();
    query(&later, &["--image", "0", "--stride", "9"]).fails(3, &["version", "9"]);
}

#[test]
fn a_video_of_one_frame_and_photos_of_one_instant() {
    let dir = tempfile::tempdir().unwrap();
    for i in 0..2 {
        picture(&dir.path().join(format!("photo{i}.png")), 150, 90, 40 * i);
    }
    let exports = ["--size", "84x56", "--export", "html,glb,masks,tracks,st4rtrack,omx4d", "--points", "100"];
    // One time: nothing can move, and every file is there.
    let out = dir.path().join("one");
    reconstruct(&dir.path().join("photo0.png"), &out, &exports).ok();
    let (shape, paths) = array(&out.join("exports/tracks/000000.npz"), "trajectory");
    assert!(shape == [1, 100, 3] && paths.iter().all(|v| v.is_finite()));
    // Two photos: each a video of its own, both at its frame 0.
    let out = dir.path().join("two");
    let photos: Vec<_> = (0..2).map(|i| dir.path().join(format!("photo{i}.png"))).collect();
    let mut command = crate::common::program();
    crate::common::finish(command.arg("reconstruct").args(&photos).arg("--out").arg(&out).args(exports)).ok();
    let images = json(&out.join("manifest.json"))["images"].clone();
    let times: Vec<_> = images.as_array().unwrap().iter().map(|i| (i["video"].as_u64(), i["frame"].as_u64())).collect();
    assert_eq!(times, [(Some(0), Some(0)), (Some(1), Some(0))]);
}

#[test]
fn what_needs_motion_is_refused_before_work() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 2), dir.path().join("out"));
    let weights = root().join("tests/data/goldens/tiny-a");
    let with = |export: &str| reconstruct(&frames, &out, &["--weights", weights.to_str().unwrap(), "--export", export]);
    with("tracks").fails(2, &["no trajectories", "--weights"]);
    assert!(!out.exists());
    reconstruct(&frames, &out, &["--export", "depth", "--all-tracks"]).fails(2, &["tracks"]);
}

#[cfg(unix)]
#[test]
fn interrupted_while_it_moves() {
    use std::io::{BufRead as _, BufReader};
    use std::process::{Command, Stdio};

    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 12), dir.path().join("out"));
    let mut command = crate::common::program();
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args([
        "--json",
        "--export",
        "npz,glb,field,html,masks",
    ]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.by_ref().map(Result::unwrap).any(|l| l.contains("\"phase\":\"sampling\"")), "no sampling");
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(130), "{said}");
    assert!(said.contains("what moves was not"), "{said}");
    assert!(rest.last().unwrap().contains("\"interrupted\""));
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(manifest["interrupted"], true);
    finite(&out.join("exports/npz/results.npz"), "depth", &[12, 84, 140]);
    assert_eq!(&fs::read(out.join("scene.glb")).unwrap()[..4], b"glTF");
    let listed: Vec<_> = manifest["files"].as_array().unwrap().iter().filter_map(|f| f["path"].as_str()).collect();
    assert!(!listed.contains(&"field.safetensors") && !out.join("field.safetensors").exists(), "{listed:?}");
    let left: Vec<_> = fs::read_dir(&out).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    assert!(left.iter().all(|n| !n.contains("tmp")), "a half file was left: {left:?}");
}
