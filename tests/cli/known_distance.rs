//! One known distance (`--scale`) brings everything to metres: depth, cameras, paths and the saved field.

use std::fs;

use crate::common::{array, folder, json, of_kind, omnix, reconstruct};

const SIZE: [&str; 2] = ["--size", "140x84"];

#[test]
fn a_known_distance_brings_all_results_to_metres() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 3);
    let run = |name: &str, more: &[&str]| {
        let out = dir.path().join(name);
        let usual = ["--export", "npz,depth,tracks,field", "--all-tracks", "--json"];
        (reconstruct(&frames, &out, &[&SIZE[..], &usual, more].concat()).ok().events(), out)
    };
    let (_, plain) = run("plain", &[]);
    let (events, out) = run("metres", &["--scale", "002.png:30,30,120,60=2.5"]);
    let scale = of_kind(&events, "metric_scale")[0]["metres"].as_f64().unwrap();
    let [before, after] = [&plain, &out].map(|out| out.join("exports/npz/results.npz"));
    let all = |name: &str| [array(&before, name).1, array(&after, name).1];
    let near = |a: f32, b: f64, err: f64| (f64::from(a) - b).abs() <= err + 1e-4 * b.abs();
    // Depth has six decimals there.
    let [a, b] = all("depth");
    assert!(a.iter().zip(&b).all(|(a, b)| near(*b, f64::from(*a) * scale, 2e-6 * (1.0 + scale))));
    let [a, b] = all("extrinsics");
    for (k, (a, b)) in a.iter().zip(&b).enumerate() {
        let times = if k % 4 == 3 { scale } else { 1.0 };
        assert!(near(*b, f64::from(*a) * times, 1e-5), "{k}: {a} {b}");
    }
    // The distance itself, in image 2, from depth and intrinsics.
    let [_, intrinsics] = all("intrinsics");
    let [_, depth] = all("depth");
    let k = &intrinsics[18..];
    let point = |x: f64, y: f64| {
        let (x, y) = ((x + 0.5) * 140.0 / 150.0 - 0.5, (y + 0.5) * 84.0 / 90.0 - 0.5);
        let z = f64::from(depth[(2 * 84 + y.round() as usize) * 140 + x.round() as usize]);
        [(x - f64::from(k[2])) / f64::from(k[0]) * z, (y - f64::from(k[5])) / f64::from(k[4]) * z, z]
    };
    let (a, b) = (point(30.0, 30.0), point(120.0, 60.0));
    let length = (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt();
    assert!((length - 2.5).abs() < 1e-3, "{length}");
    // Paths, and what a query of the saved field says of one.
    let tracks = |out: &std::path::Path| array(&out.join("exports/tracks/000001.npz"), "trajectory").1;
    let (a, b) = (tracks(&plain), tracks(&out));
    let most = a.iter().fold(0f32, |m, v| m.max(v.abs()));
    assert!(a.iter().zip(&b).all(|(a, b)| near(*b, f64::from(*a) * scale, 1e-4 * scale * f64::from(most))));
    let (field, asked) = (out.join("field.safetensors"), dir.path().join("asked.npz"));
    let query = ["query", field.to_str().unwrap(), "--image", "1", "--pixel", "9,7", "--out", asked.to_str().unwrap()];
    omnix(&query).ok();
    let found = array(&asked, "trajectory").1;
    for time in 0..3 {
        assert_eq!(found[3 * time..][..3], b[3 * (time * 140 * 84 + 7 * 140 + 9)..][..3]);
    }
    // The unit is in every file that states one.
    let manifest = json(&out.join("manifest.json"));
    assert_eq!(
        (&manifest["unit_of_length"], &json(&out.join("depth/depth.json"))["unit"]),
        (&"metres".into(), &"metres".into())
    );
    assert_eq!(manifest["settings"]["scale"], "002.png:30,30,120,60=2.5");
}

#[test]
fn a_distance_that_has_no_meaning_is_refused_before_any_work() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 3), dir.path().join("out"));
    let run = |more: &[&str], code: i32, words: &[&str]| drop(reconstruct(&frames, &out, more).fails(code, words));
    run(&["--scale", "9.png:1,1,2,2=1"], 2, &["9.png", "000.png"]);
    run(&["--scale", "1,1,200,2=1"], 2, &["200,2", "150x90"]);
    run(&["--scale", "1,1,2,2=1", "--window", "2"], 2, &["--scale", "windows"]);
    omnix(&["plan", frames.to_str().unwrap(), "--scale", "1,1,2=1"]).fails(2, &["metres between them"]);
    assert!(!out.exists() || fs::read_dir(&out).unwrap().count() == 0);
}
