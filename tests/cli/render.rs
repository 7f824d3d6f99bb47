//! Pictures and films of a run, as a user gets them.

use std::fs;
use std::path::{Path, PathBuf};

use image::{DynamicImage, RgbImage};

use crate::common::{Ran, finish, of_kind, omnix, program, reconstruct};

/// A run on three pictures whose red grows to the right and whose green grows downwards.
fn run(dir: &Path, export: &str) -> PathBuf {
    let frames = dir.join("frames");
    fs::create_dir_all(&frames).unwrap();
    let picture = RgbImage::from_fn(168, 112, |x, y| image::Rgb([(x * 255 / 167) as u8, (y * 255 / 111) as u8, 128]));
    (0..3).for_each(|k| picture.save(frames.join(format!("{k}.png"))).unwrap());
    let out = dir.join("run");
    reconstruct(&frames, &out, &["--size", "84x56", "--export", export]).ok();
    out
}

fn render(run: &Path, out: &Path, more: &[&str]) -> Ran {
    omnix(&[&["render", run.to_str().unwrap(), "--out", out.to_str().unwrap()], more].concat())
}

fn open(path: &Path) -> DynamicImage {
    image::open(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

#[test]
fn the_camera_of_an_image_sees_that_image() {
    let dir = tempfile::tempdir().unwrap();
    let run = run(dir.path(), "npz");
    let pictures = dir.path().join("pictures");
    let view = ["--view", "input", "--show", "nearest", "--size", "84x56", "--between", "0", "--background", "black"];
    let events = render(&run, &pictures, &[&view[..], &["--json"]].concat()).ok().events();
    assert_eq!(fs::read_dir(&pictures).unwrap().count(), 3);
    for index in 0..3 {
        let seen = open(&pictures.join(format!("{index:06}.png"))).into_rgb8();
        assert_eq!(seen.dimensions(), (84, 56));
        let (mut off, mut full) = (0.0, 0);
        for (x, y, pixel) in seen.enumerate_pixels().filter(|(_, _, pixel)| pixel[2] > 100) {
            let want = [255.0 * (f64::from(x) + 0.5) / 84.0, 255.0 * (f64::from(y) + 0.5) / 56.0];
            off += (0..2).map(|c| (f64::from(pixel[c]) - want[c]).abs()).sum::<f64>() / 2.0;
            full += 1;
        }
        // Edges of depth are left out; the rest is where it was seen.
        assert!(full > 84 * 56 / 2, "{full} pixels of image {index}");
        assert!(off / f64::from(full) < 5.0, "image {index}: off by {} on average", off / f64::from(full));
    }
    let plan = of_kind(&events, "plan")[0];
    assert_eq!((&plan["pictures"], &plan["images"]), (&3.into(), &3.into()));
    assert!(
        plan["peak_bytes"].as_u64() > Some(1 << 20) && plan["process_bytes"].as_u64() > plan["peak_bytes"].as_u64()
    );
    let done = of_kind(&events, "done")[0];
    assert!(done["points"].as_u64() > Some(3 * 84 * 56 / 2) && done["moving"] == 0, "{done}");
}

#[test]
fn a_field_becomes_a_film_and_the_same_pictures_again() {
    let dir = tempfile::tempdir().unwrap();
    let run = run(dir.path(), "field");
    let small = ["--size", "161x91", "--frames", "5"];
    let film = dir.path().join("film.mp4");
    render(&run, &film, &small).ok();
    let bytes = fs::read(&film).unwrap();
    assert!(bytes.len() > 1000 && &bytes[4..8] == b"ftyp");
    let [once, again] = ["once", "again"].map(|name| dir.path().join(name));
    for out in [&once, &again] {
        // The file itself, from a path of its own.
        render(&run.join("field.safetensors"), out, &small).ok();
    }
    for index in 0..5 {
        let [a, b] = [&once, &again].map(|out| fs::read(out.join(format!("{index:06}.png"))).unwrap());
        assert!(a == b, "picture {index}");
    }
    // From the other side of the turn it looks different.
    assert_ne!(fs::read(once.join("000001.png")).unwrap(), fs::read(once.join("000004.png")).unwrap());
}

#[test]
fn one_picture_may_have_no_background() {
    let dir = tempfile::tempdir().unwrap();
    let run = run(dir.path(), "npz");
    let path = dir.path().join("new/still.png");
    let look = ["--view", "still", "--away", "4", "--size", "160x96", "--background", "none", "--frusta", "no"];
    render(&run, &path, &look).ok();
    let seen = open(&path).into_rgba8();
    assert_eq!((seen.get_pixel(0, 0)[3], seen.get_pixel(159, 95)[3]), (0, 0));
    assert!(seen.pixels().filter(|pixel| pixel[3] == 255).count() > 300);
    let keys = dir.path().join("keys.json");
    fs::write(
        &keys,
        r#"{"keys": [{"position": [0, 0, -1], "target": [0, 0, 1]}, {"position": [1, 0, -1], "target": [0, 0, 1]}]}"#,
    )
    .unwrap();
    let flown = dir.path().join("flown");
    render(&run, &flown, &["--view", keys.to_str().unwrap(), "--frames", "2", "--size", "64x48"]).ok();
    assert_eq!(fs::read_dir(&flown).unwrap().count(), 2);
}

#[test]
fn what_cannot_be_rendered_is_said_before_any_work() {
    let dir = tempfile::tempdir().unwrap();
    let empty = dir.path().join("empty");
    fs::create_dir_all(&empty).unwrap();
    let out = dir.path().join("out");
    render(&empty, &out, &[]).fails(3, &["nothing to render", "--export field", "npz"]);
    render(&dir.path().join("none"), &out, &[]).fails(3, &["none"]);
    let run = run(dir.path(), "npz,field");
    let film = dir.path().join("film.mp4");
    let no_encoder = ["render", run.to_str().unwrap(), "--out", film.to_str().unwrap()];
    finish(program().env("OMNIX_FFMPEG", "no-such-program").args(no_encoder)).fails(6, &["ffmpeg", "film.mp4"]);
    render(&run, &film, &["--background", "none"]).fails(2, &["--background"]);
    render(&run, &out, &["--times", "3"]).fails(2, &["no time 3"]);
    render(&run, &out, &["--image", "3"]).fails(2, &["no image 3"]);
    render(&run, &out.join("a.png"), &["--times", "0..2"]).fails(2, &["one picture"]);
    render(&run, &out, &["--memory-budget", "20MiB"]).fails(5, &["--points", "--size"]);
    for size in ["0x0", "4294967296x2", "99999x99999"] {
        render(&run, &out, &["--size", size]).fails(2, &["--size"]);
    }
    let keys = dir.path().join("keys.json");
    fs::write(&keys, "{}").unwrap();
    render(&run, &out, &["--view", keys.to_str().unwrap()]).fails(2, &["keys.json", "keys"]);
    assert!(!out.exists() && !film.exists());
}
