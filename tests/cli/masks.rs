//! Masks: what is left out is nowhere in the results, what is said to stand still or to move does, everywhere alike.

use std::fs;
use std::path::{Path, PathBuf};

use crate::common::{array, folder, json, omnix, reconstruct};

/// A mask for each of the pictures that [`folder`] makes, as large as they are: white but for what `black` says.
fn masks(dir: &Path, count: u32, black: impl Fn(u32, u32) -> bool) -> String {
    for i in 0..count {
        let path = dir.join(format!("{i:03}.png.png"));
        fs::create_dir_all(dir).unwrap();
        let at = |x, y| image::Luma([if black(x, y) { 0u8 } else { 255 }]);
        image::GrayImage::from_fn(150, 90, at).save(path).unwrap();
    }
    dir.to_str().unwrap().to_owned()
}

const SIZE: [&str; 2] = ["--size", "140x84"];
const PIXELS: usize = 140 * 84;

fn run(frames: &Path, out: &Path, more: &[&str]) -> PathBuf {
    reconstruct(frames, out, &[&SIZE[..], more].concat()).ok();
    out.to_owned()
}

/// Columns and rows of the followed pixels.
fn pixels(tracks: &Path) -> Vec<i32> {
    npyz::npz::NpzArchive::open(tracks).unwrap().by_name("pixel").unwrap().unwrap().into_vec().unwrap()
}

/// Columns of the network's pictures of which the masks' left half is black.
fn left(pixel: usize) -> bool {
    pixel % 140 < 70
}

#[test]
fn what_is_left_out_is_nowhere() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 3);
    let half = masks(&dir.path().join("half"), 3, |x, _| x < 75);
    let exports = "npz,depth,ply,glb,exr,tracks,st4rtrack,masks,html,omx4d,field";
    let out = run(&frames, &dir.path().join("out"), &["--masks", &half, "--export", exports, "--points", "600"]);
    let npz = out.join("exports/npz/results.npz");
    let (depth, confidence) = (array(&npz, "depth").1, array(&npz, "conf").1);
    for (k, (z, c)) in depth.iter().zip(&confidence).enumerate() {
        assert_eq!((*z == 0.0, *c == 0.0), (left(k % PIXELS), left(k % PIXELS)), "{k}");
    }
    let grey = image::open(out.join("depth/000001.png")).unwrap().into_luma16();
    assert!(grey.pixels().enumerate().all(|(k, p)| (p.0[0] == 0) == left(k)));
    for image in 0..3 {
        let tracks = out.join(format!("exports/tracks/{image:06}.npz"));
        assert!(pixels(&tracks).chunks(2).all(|p| p[0] >= 70));
        assert!(array(&tracks, "trajectory").1.iter().all(|v| v.is_finite()));
    }
    let ply = fs::read(out.join("points.ply")).unwrap();
    let head = String::from_utf8_lossy(&ply[..400.min(ply.len())]).into_owned();
    let count = head.lines().find_map(|l| l.strip_prefix("element vertex ")).unwrap().parse::<usize>().unwrap();
    assert!(count > 0 && count <= 600, "{count}");
    let npy = fs::read(out.join("exports/st4rtrack/conf1_p2.npy")).unwrap();
    let confidence: Vec<f32> = npyz::NpyFile::new(&npy[..]).unwrap().into_vec().unwrap();
    assert!(confidence.iter().enumerate().all(|(k, c)| (*c == 0.0) == left(k)));
    let manifest = json(&out.join("manifest.json"));
    let said = &manifest["settings"]["masks"];
    assert!(said["digest"].as_str().unwrap().starts_with("blake3:") && said["ignore"][0] == half.as_str(), "{said}");
    assert_eq!(said["pixels"]["ignored"], 3 * PIXELS as u64 / 2);
    // What is not masked is as it was.
    let white = masks(&dir.path().join("white"), 3, |_, _| false);
    let [with, without] = [&["--masks", &white][..], &[]].map(|more| {
        let out = dir.path().join(format!("same{}", more.len()));
        run(&frames, &out, &[more, &["--export", "npz,tracks"]].concat())
    });
    for file in ["exports/npz/results.npz", "exports/tracks/000001.npz"] {
        assert!(fs::read(with.join(file)).unwrap() == fs::read(without.join(file)).unwrap(), "{file}");
    }
}

#[test]
fn what_is_forced_is_the_same_in_results_file_and_query() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 3);
    let still = masks(&dir.path().join("still"), 3, |x, _| x >= 50);
    let moving = masks(&dir.path().join("moving"), 3, |x, y| x < 100 || y < 45);
    let (still, moving) = (format!("still={still}"), format!("moving={moving}"));
    let masked = ["--masks", &still, "--masks", &moving, "--all-tracks", "--export", "tracks,masks,field"];
    let forced = |k: usize| match (k % 140, k / 140) {
        (0..47, _) => Some(false),
        (93.., 42..) => Some(true),
        _ => None,
    };
    // On the device, and beside it.
    for (name, more) in [("out", &[][..]), ("tight", &["--memory-budget", "40MiB"])] {
        let out = run(&frames, &dir.path().join(name), &[&masked[..], more].concat());
        for image in 0..3 {
            let moves = image::open(out.join(format!("masks/{image:06}.png"))).unwrap().into_luma8();
            for (k, p) in moves.pixels().enumerate() {
                assert!(forced(k).is_none_or(|forced| (p.0[0] == 255) == forced), "image {image}, pixel {k}");
            }
            let tracks = out.join(format!("exports/tracks/{image:06}.npz"));
            let (_, paths) = array(&tracks, "trajectory");
            let at = |time: usize, k: usize| &paths[3 * (time * PIXELS + k)..][..3];
            assert!((0..PIXELS).filter(|k| forced(*k) == Some(false)).all(|k| at(0, k) == at(2, k)));
            assert!((0..PIXELS).any(|k| forced(k) == Some(true) && at(0, k) != at(2, k)));
            let asked = dir.path().join("asked.npz");
            let field = out.join("field.safetensors");
            let image_arg = image.to_string();
            let query = ["query", field.to_str().unwrap(), "--image", &image_arg, "--out", asked.to_str().unwrap()];
            omnix(&[&query[..], &["--pixel", "3,3", "--pixel", "120,60", "--pixel", "80,30"]].concat()).ok();
            let (_, found) = array(&asked, "trajectory");
            for time in 0..3 {
                for (n, k) in [3 * 140 + 3, 60 * 140 + 120, 30 * 140 + 80].into_iter().enumerate() {
                    assert_eq!(&found[3 * (3 * time + n)..][..3], at(time, k), "image {image} time {time}");
                }
            }
        }
    }
}

#[test]
fn windows_keep_to_masks_and_are_found_again_with_the_same_ones() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 10);
    let half = masks(&dir.path().join("half"), 10, |x, _| x < 75);
    let more = ["--masks", &half, "--window", "6", "--export", "npz,tracks", "--points", "300"];
    let out = run(&frames, &dir.path().join("out"), &more);
    let manifest = json(&out.join("manifest.json"));
    let first = manifest["windows"]["parts"][0]["folder"].as_str().unwrap().to_owned();
    let (_, depth) = array(&out.join(&first).join("exports/npz/results.npz"), "depth");
    assert!(depth.iter().enumerate().all(|(k, z)| (*z == 0.0) == left(k % PIXELS)));
    let followed = pixels(&out.join(&first).join("exports/tracks/000001.npz"));
    assert!(followed.chunks(2).all(|p| p[0] >= 70));
}

#[test]
fn alpha_leaves_out_what_it_hides() {
    let dir = tempfile::tempdir().unwrap();
    let frames = dir.path().join("frames");
    fs::create_dir_all(&frames).unwrap();
    for i in 0..2u8 {
        let at = |x: u32, y: u32| image::Rgba([(x * 3) as u8 ^ i, (y * 5) as u8, 90, if x < 75 { 0 } else { 255 }]);
        image::RgbaImage::from_fn(150, 90, at).save(frames.join(format!("{i}.png"))).unwrap();
    }
    let out = run(&frames, &dir.path().join("out"), &["--alpha-masks", "--export", "npz"]);
    let (_, depth) = array(&out.join("exports/npz/results.npz"), "depth");
    assert!(depth.iter().enumerate().all(|(k, z)| (*z == 0.0) == left(k % PIXELS)));
    let plain = folder(dir.path().join("plain").as_path(), 2);
    reconstruct(&plain, &dir.path().join("none"), &["--alpha-masks"]).fails(2, &["alpha channel"]);
}

#[test]
fn masks_that_do_not_fit_are_refused_before_any_work() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 2), dir.path().join("out"));
    let other = masks(&dir.path().join("other"), 2, |_, _| true);
    for i in 0..2 {
        fs::rename(Path::new(&other).join(format!("{i:03}.png.png")), Path::new(&other).join(format!("x{i}.png")))
            .unwrap();
    }
    let run = |more: &[&str], code: i32, words: &[&str]| drop(reconstruct(&frames, &out, more).fails(code, words));
    run(&["--masks", &other], 3, &["x0.png", "000.png", "cannot be used"]);
    run(&["--masks", "nowhere"], 3, &["nowhere", "folder"]);
    let white = masks(&dir.path().join("white"), 2, |_, _| false);
    let (still, moving) = (format!("still={white}"), format!("moving={white}"));
    run(&["--masks", &still, "--masks", &moving], 3, &["000.png", "stand still", "move"]);
    let tiny = crate::common::root().join("tests/data/goldens/tiny-a");
    run(&["--masks", &still, "--weights", tiny.to_str().unwrap()], 2, &["no trajectories"]);
    assert!(!out.exists() || fs::read_dir(&out).unwrap().count() == 0);
}
