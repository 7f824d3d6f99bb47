//! Every export read back by other code: npyz, the image crate, small parsers of our own.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
};

use npyz::npz::NpzArchive;
use omnix_io::{Export, RunSummary, SinkOptions, open_sinks};
use serde_json::Value;

use crate::common::Made;

const ALL: &str = "npz,mini_npz,depth,ply,glb,tum";

/// Runs `images` made-up results (video, frame) through the exports.
pub(crate) fn run(
    dir: &Path,
    list: &str,
    options: &SinkOptions,
    images: &[(u32, u32)],
    interrupted: bool,
) -> Vec<PathBuf> {
    let made = Made::new(28, 14);
    let mut sinks = open_sinks(&Export::parse_list(list).unwrap(), dir, options).unwrap();
    for (index, &(video, frame)) in images.iter().enumerate() {
        for sink in &mut sinks {
            sink.frame(&made.frame(index, video, frame)).unwrap();
        }
    }
    sinks.into_iter().flat_map(|s| s.finish(&RunSummary { interrupted }).unwrap()).collect()
}

const IMAGES: [(u32, u32); 3] = [(0, 0), (0, 1), (0, 2)];

fn array<T: npyz::Deserialize>(path: &Path, name: &str) -> (Vec<u64>, Vec<T>) {
    let mut archive = NpzArchive::open(path).unwrap();
    let array = archive.by_name(name).unwrap().unwrap_or_else(|| panic!("no array {name}"));
    (array.shape().to_vec(), array.into_vec().unwrap())
}

#[test]
fn npz_layouts() {
    let dir = tempfile::tempdir().unwrap();
    let files = run(dir.path(), "npz-mini_npz", &SinkOptions::default(), &IMAGES, false);
    let (full, mini) = (dir.path().join("exports/npz/results.npz"), dir.path().join("exports/mini_npz/results.npz"));
    assert_eq!(files, [full.clone(), mini.clone()]);
    let made = Made::new(28, 14);
    let (shape, image) = array::<u8>(&full, "image");
    assert_eq!((shape.as_slice(), &image[..made.rgb.len()]), (&[3, 14, 28, 3][..], made.rgb.as_slice()));
    for path in [&full, &mini] {
        let (shape, depth) = array::<f32>(path, "depth");
        assert_eq!(shape, [3, 14, 28]);
        for (a, b) in depth[28 * 14..].iter().zip(&made.depth) {
            assert!(a == b || (a - b).abs() < 6e-7, "{a} {b}");
        }
        let (_, conf) = array::<f32>(path, "conf");
        assert!((conf[13] - 1.3).abs() < 1e-6, "{}", conf[13]);
        let (shape, extrinsics) = array::<f32>(path, "extrinsics");
        assert_eq!((shape.as_slice(), extrinsics[12 + 3]), (&[3, 3, 4][..], -0.25));
        let (shape, intrinsics) = array::<f32>(path, "intrinsics");
        assert_eq!((shape.as_slice(), intrinsics[2]), (&[3, 3, 3][..], 14.0));
        let (shape, sky) = array::<bool>(path, "sky");
        assert_eq!((shape.as_slice(), &sky[28 * 14..][..made.sky.len()]), (&[3, 14, 28][..], made.sky.as_slice()));
    }
    assert_eq!(NpzArchive::open(&mini).unwrap().array_names().count(), 5);
}

#[test]
fn npz_leaves_out_what_is_absent() {
    let dir = tempfile::tempdir().unwrap();
    let made = Made::new(28, 14);
    let mut sinks = open_sinks(&[Export::Npz], dir.path(), &SinkOptions::default()).unwrap();
    let mut frame = made.frame(0, 0, 0);
    (frame.confidence, frame.extrinsics, frame.intrinsics, frame.sky) = (None, None, None, None);
    sinks[0].frame(&frame).unwrap();
    let path = sinks.remove(0).finish(&RunSummary::default()).unwrap().remove(0);
    let mut names: Vec<String> = NpzArchive::open(path).unwrap().array_names().map(str::to_owned).collect();
    names.sort();
    assert_eq!(names, ["depth", "image"]);
}

#[test]
fn depth_pictures() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), "depth", &SinkOptions::default(), &IMAGES, false);
    let made = Made::new(28, 14);
    let sidecar: Value = serde_json::from_slice(&fs::read(dir.path().join("depth/depth.json")).unwrap()).unwrap();
    let entry = &sidecar["images"][1];
    assert_eq!(entry["file"], "depth/000001.png");
    let scale = entry["scale"].as_f64().unwrap() as f32;
    let image::DynamicImage::ImageLuma16(values) = image::open(dir.path().join("depth/000001.png")).unwrap() else {
        panic!("not 16-bit grey")
    };
    assert_eq!((values.as_raw()[0], values.as_raw()[1], entry["invalid_pixels"].as_u64()), (0, 0, Some(2)));
    for (value, depth) in values.as_raw().iter().zip(&made.depth).skip(2) {
        assert!((f32::from(*value) * scale - depth).abs() <= 0.5 * scale, "{value} {depth}");
    }
    assert!(*values.as_raw().iter().max().unwrap() > 32_000, "half of the range is unused");
    // The text chunk says the same as the sidecar.
    let bytes = fs::read(dir.path().join("depth/000001.png")).unwrap();
    let text = format!("omnix:depth_scale\0{scale}");
    assert!(bytes.windows(text.len()).any(|w| w == text.as_bytes()), "no scale in the file");
    let colour = image::open(dir.path().join("depth_color/000001.png")).unwrap().into_rgb8();
    assert_eq!(colour.get_pixel(0, 0).0, [0, 0, 0]);
    assert_eq!(colour.get_pixel(2, 0).0, [158, 1, 66], "near is the red end");
    assert_eq!(colour.get_pixel(27, 13).0, [94, 79, 162]);
}

struct Ply {
    header: String,
    points: Vec<([f32; 3], [u8; 3], f32)>,
}

fn read_ply(path: &Path) -> Ply {
    let bytes = fs::read(path).unwrap();
    let marker = b"end_header\n";
    let end = bytes.windows(marker.len()).position(|w| w == marker).unwrap() + marker.len();
    let header = String::from_utf8(bytes[..end].to_vec()).unwrap();
    let f = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
    assert_eq!((bytes.len() - end) % 19, 0);
    let point = |b: &[u8]| ([f(&b[..4]), f(&b[4..8]), f(&b[8..12])], [b[12], b[13], b[14]], f(&b[15..19]));
    let points: Vec<_> = bytes[end..].chunks_exact(19).map(point).collect();
    assert!(header.contains(&format!("element vertex {}\n", points.len())), "{header}");
    Ply { header, points }
}

#[test]
fn ply_points_are_where_the_camera_saw_them() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), "ply", &SinkOptions::default(), &IMAGES, false);
    let made = Made::new(28, 14);
    let ply = read_ply(&dir.path().join("points.ply"));
    assert_eq!(ply.points.len(), 3 * (28 * 14 - 3), "hole, infinity and sky make no points");
    assert!(ply.header.contains("property float confidence") && ply.header.contains("world frame"), "{}", ply.header);
    // Image 1, pixel (5, 2): the camera is at x = 0.25, focal length 28, principal point (14, 7).
    let pixel = 2 * 28 + 5;
    let d = made.depth[pixel];
    let (position, colour, confidence) = ply.points[28 * 14 - 3 + pixel - 3];
    let expected = [(5.0 - 14.0) / 28.0 * d + 0.25, (2.0 - 7.0) / 28.0 * d, d];
    assert!(position.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{position:?} {expected:?}");
    assert_eq!((colour.as_slice(), confidence), (&made.rgb[3 * pixel..][..3], made.confidence[pixel]));
}

#[test]
fn ply_filter_and_limit() {
    let dir = tempfile::tempdir().unwrap();
    let options = SinkOptions::default().ply_confidence_percentile(Some(50.0)).ply_max_points(Some(100));
    run(dir.path(), "ply", &options, &IMAGES, false);
    let ply = read_ply(&dir.path().join("points.ply"));
    assert_eq!(ply.points.len(), 100);
    assert!(ply.points.iter().all(|p| p.2 >= 1.39), "a point below the median");
    let last_camera = ply.points.iter().filter(|p| p.0[2] > 2.3).count();
    assert!(last_camera > 10, "points are not spread: {last_camera}");
    let unlimited = options.ply_max_points(None);
    run(dir.path(), "ply", &unlimited, &IMAGES, false);
    let count = read_ply(&dir.path().join("points.ply")).points.len();
    assert!((580..=720).contains(&count), "{count} of 1167 points are at or above the median, five or six tenths");
}

fn read_glb(path: &Path) -> (Value, Vec<u8>) {
    let bytes = fs::read(path).unwrap();
    let word = |at: usize| u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()) as usize;
    assert_eq!((&bytes[..4], word(4), word(8)), (&b"glTF"[..], 2, bytes.len()));
    let json = word(12);
    assert_eq!((&bytes[16..20], json % 4), (&b"JSON"[..], 0));
    assert_eq!((&bytes[24 + json..28 + json], word(20 + json)), (&b"BIN\0"[..], bytes.len() - 28 - json));
    (serde_json::from_slice(&bytes[20..20 + json]).unwrap(), bytes[28 + json..].to_vec())
}

fn positions(document: &Value, buffer: &[u8], mesh: usize) -> Vec<[f32; 3]> {
    let accessor = &document["accessors"]
        [document["meshes"][mesh]["primitives"][0]["attributes"]["POSITION"].as_u64().unwrap() as usize];
    let view = &document["bufferViews"][accessor["bufferView"].as_u64().unwrap() as usize];
    let start = view["byteOffset"].as_u64().unwrap() as usize;
    let bytes = &buffer[start..start + view["byteLength"].as_u64().unwrap() as usize];
    let f = |b: &[u8]| f32::from_le_bytes(b.try_into().unwrap());
    let points: Vec<[f32; 3]> = bytes.chunks_exact(12).map(|b| [f(&b[..4]), f(&b[4..8]), f(&b[8..])]).collect();
    assert_eq!(points.len() as u64, accessor["count"].as_u64().unwrap());
    points
}

#[test]
fn glb_is_centred_and_draws_the_cameras() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), "glb", &SinkOptions::default(), &IMAGES, false);
    let (document, buffer) = read_glb(&dir.path().join("scene.glb"));
    let points = positions(&document, &buffer, 0);
    for axis in 0..3 {
        let mut values: Vec<f32> = points.iter().map(|p| p[axis]).collect();
        values.sort_by(f32::total_cmp);
        let n = values.len();
        let median = (values[n / 2] + values[(n - 1) / 2]) / 2.0;
        assert!(median.abs() < 1e-5, "median of axis {axis} is {median}");
    }
    // p40 of confidences 1.0, 1.1, ... 1.9 in equal shares is 1.4 (or just below, by interpolation).
    let threshold = document["asset"]["extras"]["confidence_threshold"].as_f64().unwrap();
    assert!((1.299..=1.401).contains(&threshold), "{threshold}");
    let lines = positions(&document, &buffer, 1);
    assert_eq!((lines.len(), &document["meshes"][1]["primitives"][0]["mode"]), (3 * 16, &Value::from(1)));
    // Cameras look along -z in glTF axes: the points lie on the negative side of the first camera's centre.
    let centre = lines[0];
    assert!(points.iter().all(|p| p[2] < centre[2]), "points behind the camera");
    assert!((lines[16][0] - centre[0] - 0.25).abs() < 1e-5, "second camera is 0.25 to the right");
    assert!(lines[1][1] > centre[1], "the top left corner is above the centre");
}

#[test]
fn glb_point_budget_and_repeatability() {
    let dirs = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let options = SinkOptions::default().glb_max_points(50).show_cameras(false);
    let bytes = dirs.each_ref().map(|dir| {
        run(dir.path(), ALL, &options, &IMAGES, false);
        let mut files = BTreeMap::new();
        for name in ["scene.glb", "points.ply", "exports/npz/results.npz", "trajectory.tum", "depth/000002.png"] {
            files.insert(name, fs::read(dir.path().join(name)).unwrap());
        }
        files
    });
    assert_eq!(bytes[0], bytes[1], "two runs give the same bytes");
    let (document, buffer) = read_glb(&dirs[0].path().join("scene.glb"));
    assert_eq!(positions(&document, &buffer, 0).len(), 50);
    assert_eq!(document["meshes"].as_array().unwrap().len(), 1);
}

#[test]
fn trajectories() {
    let dir = tempfile::tempdir().unwrap();
    run(dir.path(), "tum", &SinkOptions::default(), &IMAGES, false);
    let text = fs::read_to_string(dir.path().join("trajectory.tum")).unwrap();
    let lines: Vec<Vec<f64>> = text
        .lines()
        .filter(|l| !l.starts_with('#'))
        .map(|l| l.split(' ').map(|v| v.parse().unwrap()).collect())
        .collect();
    assert_eq!(lines[2], [0.066_666_667, 0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let several = tempfile::tempdir().unwrap();
    let files = run(several.path(), "tum", &SinkOptions::default(), &[(0, 0), (0, 1), (3, 0)], false);
    let names: Vec<_> = files.iter().map(|f| f.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["trajectory_0.tum", "trajectory_3.tum", "frame_times.csv"]);
    let times = fs::read_to_string(several.path().join("frame_times.csv")).unwrap();
    assert_eq!(times.lines().nth(2).unwrap(), "1,0,1,0.03333333333333333");
}

#[test]
fn interrupted_runs_are_readable() {
    let dir = tempfile::tempdir().unwrap();
    let files = run(dir.path(), ALL, &SinkOptions::default(), &IMAGES[..1], true);
    assert!(files.iter().all(|f| f.is_file()), "{files:?}");
    assert_eq!(array::<f32>(&dir.path().join("exports/npz/results.npz"), "depth").0, [1, 14, 28]);
    assert!(read_ply(&dir.path().join("points.ply")).header.contains("interrupted"));
    assert_eq!(read_glb(&dir.path().join("scene.glb")).0["asset"]["extras"]["interrupted"], true);
    let nothing = tempfile::tempdir().unwrap();
    assert_eq!(run(nothing.path(), ALL, &SinkOptions::default(), &[], true), Vec::<PathBuf>::new());
    assert_eq!(fs::read_dir(nothing.path()).unwrap().count(), 0, "no empty files");
}

#[test]
fn dropped_sinks_leave_no_half_files() {
    let dir = tempfile::tempdir().unwrap();
    let made = Made::new(28, 14);
    let mut sinks =
        open_sinks(&Export::parse_list("npz,ply,glb,tum").unwrap(), dir.path(), &SinkOptions::default()).unwrap();
    sinks.iter_mut().for_each(|s| s.frame(&made.frame(0, 0, 0)).unwrap());
    drop(sinks);
    assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
}
