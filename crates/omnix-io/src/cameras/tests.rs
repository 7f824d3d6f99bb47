//! Each format from the same two cameras; matching; what is refused; distortion.

use std::path::PathBuf;

use super::*;
use crate::Picture;
use crate::input::{InputPlan, PlannedFrame, Source};

/// World-to-camera of two cameras: one turned by 90 degrees about y and moved, one at the origin.
const POSES: [[[f32; 4]; 3]; 2] = [
    [[0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 0.0, 2.0], [-1.0, 0.0, 0.0, 3.0]],
    [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
];
const HALF: f64 = std::f64::consts::FRAC_1_SQRT_2;

/// Writes a model of these two in COLMAP's text form.
fn colmap_text(dir: &Path, model: &str, parameters: &str) {
    std::fs::write(dir.join("cameras.txt"), format!("# cameras\n\n7 {model} 640 480 {parameters}\n")).unwrap();
    let images =
        format!("# images\n1 {HALF} 0 {HALF} 0 1 2 3 7 left/a b.png\n10.5 20.5 -1 3 4 5\n2 1 0 0 0 0 0 0 7 c.jpg\n\n");
    std::fs::write(dir.join("images.txt"), images).unwrap();
}

fn colmap_binary(dir: &Path) {
    let mut cameras = 1u64.to_le_bytes().to_vec();
    cameras.extend([7u32.to_le_bytes(), 1u32.to_le_bytes()].concat());
    cameras.extend([640u64.to_le_bytes(), 480u64.to_le_bytes()].concat());
    cameras.extend([500.0f64, 510.0, 320.0, 240.0].map(f64::to_le_bytes).concat());
    std::fs::write(dir.join("cameras.bin"), cameras).unwrap();
    let mut images = 2u64.to_le_bytes().to_vec();
    for (id, q, t, name, points) in [
        (1u32, [HALF, 0.0, HALF, 0.0], [1.0, 2.0, 3.0], "left/a b.png", 2u64),
        (2, [1.0, 0.0, 0.0, 0.0], [0.0; 3], "c.jpg", 0),
    ] {
        images.extend(id.to_le_bytes());
        images.extend(q.map(f64::to_le_bytes).concat());
        images.extend(t.map(f64::to_le_bytes).concat());
        images.extend(7u32.to_le_bytes());
        images.extend([name.as_bytes(), b"\0"].concat());
        images.extend(points.to_le_bytes());
        images.extend(vec![0u8; 24 * points as usize]);
    }
    std::fs::write(dir.join("images.bin"), images).unwrap();
}

/// Camera-to-world with OpenGL axes of [`POSES`].
const OPENGL: [&str; 2] =
    ["[[0,0,1,3],[0,-1,0,-2],[1,0,0,-1],[0,0,0,1]]", "[[1,0,0,0],[0,-1,0,0],[0,0,-1,0],[0,0,0,1]]"];

fn transforms(dir: &Path, head: &str) -> PathBuf {
    let path = dir.join("transforms.json");
    let frames = format!(
        r#"[{{"file_path":"./left/a b.png","transform_matrix":{}}},{{"file_path":"c","transform_matrix":{}}}]"#,
        OPENGL[0], OPENGL[1]
    );
    std::fs::write(&path, format!("{{{head},\"frames\":{frames},\"aabb_scale\":4}}")).unwrap();
    path
}

fn tum(dir: &Path, lens: &str) -> PathBuf {
    let path = dir.join("groundtruth.txt");
    // Centre and turn of camera-to-world.
    std::fs::write(
        &path,
        format!("# timestamp tx ty tz qx qy qz qw\n10.00 3 -2 -1 0 {} 0 {HALF}\n10.10 0 0 0 0 0 0 1\n", -HALF),
    )
    .unwrap();
    std::fs::write(dir.join("intrinsics.txt"), lens).unwrap();
    path
}

fn frame(index: usize, path: &str, time_s: Option<f64>) -> PlannedFrame {
    let index_32 = index as u32;
    PlannedFrame {
        index,
        video: 0,
        frame: index_32,
        source_frame: index_32,
        time_s,
        path: path.into(),
        width: 320,
        height: 240,
        bytes: 0,
    }
}

fn plan(frames: Vec<PlannedFrame>) -> InputPlan {
    let source = Source { input: "in".into(), path: "in".into(), video: 0, kind: SourceKind::Images(vec![]) };
    InputPlan { sources: vec![source], frames, notes: vec![] }
}

use crate::input::SourceKind;

fn two() -> InputPlan {
    plan(vec![frame(0, "in/left/a b.png", None), frame(1, "in/c.jpg", None)])
}

fn close(a: [[f32; 4]; 3], b: [[f32; 4]; 3]) -> bool {
    a.as_flattened().iter().zip(b.as_flattened()).all(|(a, b)| (a - b).abs() < 1e-6)
}

#[test]
fn every_format_says_the_same() {
    let dirs: [tempfile::TempDir; 4] = std::array::from_fn(|_| tempfile::tempdir().unwrap());
    colmap_text(dirs[0].path(), "PINHOLE", "500 510 320 240");
    colmap_binary(dirs[1].path());
    transforms(dirs[2].path(), r#""w":640,"h":480,"fl_x":500,"fl_y":510,"cx":320,"cy":240"#);
    tum(dirs[3].path(), "500 510 319.5 239.5 640 480\n");
    let times = plan(vec![frame(0, "rgb/10.001.png", None), frame(1, "rgb/x.png", Some(10.1))]);
    let paths = [
        dirs[0].path().to_owned(),
        dirs[1].path().join("images.bin"),
        dirs[2].path().to_owned(),
        dirs[3].path().join("groundtruth.txt"),
    ];
    for (path, plan) in paths.iter().zip([&two(), &two(), &two(), &times]) {
        let given = read(path).unwrap();
        let matched = match_cameras(&given, plan).unwrap();
        for (camera, pose) in matched.iter().zip(POSES) {
            assert!(close(camera.world_to_camera, pose), "{}: {:?}", given.format, camera.world_to_camera);
            // Pictures of half the size.
            assert_eq!(camera.lens.intrinsics([320, 240]), [[250.0, 0.0, 160.0], [0.0, 255.0, 120.0], [0.0, 0.0, 1.0]]);
            assert!(camera.lens.distortion.is_none());
        }
    }
}

#[test]
fn lenses_in_all_their_forms() {
    let dir = tempfile::tempdir().unwrap();
    let radial = |k: &[f64], p: [f64; 2]| {
        let mut all = [0.0; 6];
        all[..k.len()].copy_from_slice(k);
        Distortion { radial: all, tangential: p }
    };
    let lens = |focal, distortion| Lens { focal, centre: Some([3.0, 4.0]), distortion };
    for (model, parameters, expected) in [
        ("SIMPLE_PINHOLE", "9 3 4", lens([9.0, 9.0], Distortion::default())),
        ("SIMPLE_RADIAL", "9 3 4 .1", lens([9.0, 9.0], radial(&[0.1], [0.0; 2]))),
        ("RADIAL", "9 3 4 .1 .2", lens([9.0, 9.0], radial(&[0.1, 0.2], [0.0; 2]))),
        ("OPENCV", "8 9 3 4 .1 .2 .3 .4", lens([8.0, 9.0], radial(&[0.1, 0.2], [0.3, 0.4]))),
        (
            "FULL_OPENCV",
            "8 9 3 4 .1 .2 .3 .4 .5 .6 .7 .8",
            lens([8.0, 9.0], radial(&[0.1, 0.2, 0.5, 0.6, 0.7, 0.8], [0.3, 0.4])),
        ),
    ] {
        colmap_text(dir.path(), model, parameters);
        assert_eq!(read(dir.path()).unwrap().cameras[0].lens, expected, "{model}");
    }
    let angle = (320.0f64 / 500.0).atan() * 2.0;
    let file = transforms(dir.path(), &format!(r#""w":640,"h":480,"camera_angle_x":{angle},"k1":0.1,"p2":0.2"#));
    let camera = &read(&file).unwrap().cameras[1];
    assert!((camera.lens.focal[0] - 500.0).abs() < 1e-9 && camera.lens.focal[0] == camera.lens.focal[1]);
    assert_eq!((camera.lens.centre, camera.lens.distortion), (None, radial(&[0.1], [0.0, 0.2])));
    let path = tum(dir.path(), "500 0 319.5\n0 510 239.5\n0 0 1\n");
    assert_eq!(read(&path).unwrap().cameras[0].lens.centre, Some([320.0, 240.0]));
}

#[track_caller]
fn refused(path: &Path, part: &str) {
    let message = read(path).unwrap_err().to_string();
    assert!(message.contains(part) && message.contains(path.file_name().unwrap().to_str().unwrap()), "{message}");
}

#[test]
fn what_is_wrong_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str, text: &str| {
        std::fs::write(dir.path().join(name), text).unwrap();
        dir.path().join(name)
    };
    assert!(read(dir.path()).unwrap_err().to_string().contains("COLMAP"));
    refused(&at("cameras.txt", ""), "lie beside each other");
    let images = at("images.txt", "1 1 0 0 0 0 0 0 7 a.png\n\n");
    for (cameras, part) in [
        ("7 PINHOLE 640", "are needed"),
        ("7 PINHOLE 640 480 1 2 3", "4 parameters"),
        ("7 PINHOLE 640 480 1 2 3 x", "no number"),
        ("7 PINHOLE 640 480 0 2 3 4", "focal length"),
        ("7 PINHOLE 640 480 nan 2 3 4", "focal length"),
        ("7 PINHOLE -1 480 1 2 3 4", "whole numbers"),
        ("7 OPENCV_FISHEYE 640 480 1 2 3 4 5 6 7 8", "image_undistorter"),
        ("7 PINHOLE 640 480 1 2 3 4\n7 PINHOLE 640 480 1 2 3 4", "twice"),
    ] {
        refused(&at("cameras.txt", cameras), part);
    }
    at("cameras.txt", "7 PINHOLE 640 480 1 2 3 4");
    for (line, part) in [
        ("1 1 0 0 0 0 0 0 8 a.png", "not among the cameras"),
        ("1 0 0 0 0 0 0 0 7 a.png", "length is not 1"),
        ("1 1 0 0 0 0 0 inf 7 a.png", "not finite"),
        ("1 1 0 0 0 0 0 0 7", "NAME"),
        ("1 1 0 0 0 0 0 0 x a.png", "whole number"),
        ("1 1 0 0 0 0 0 0 7 a.png\n2 1 0 0 0 0 0 0 7 b.png", "line 2: X, Y and POINT3D_ID"),
    ] {
        at("images.txt", line);
        refused(&images, part);
    }
    let json = dir.path().join("transforms.json");
    let frame = |matrix: &str| {
        format!(r#"{{"w":64,"h":48,"fl_x":50,"frames":[{{"file_path":"a","transform_matrix":{matrix}}}]}}"#)
    };
    for (text, part) in [
        ("[]".to_owned(), "no transforms.json"),
        (frame("[[1,0,0],[0,1,0],[0,0,1]]"), "rows of 4"),
        (frame("[[1,0,0,0],[0,1,0,0],[0,0,-1,0]]"), "mirrors"),
        (frame("[[1000,0,0,0],[0,1000,0,0],[0,0,1000,0]]"), "no rotation"),
        (frame(OPENGL[1]).replace("50", "-50"), "focal length"),
        (frame(OPENGL[1]).replace("\"fl_x\":50,", ""), "focal length is needed"),
        (frame(OPENGL[1]).replace("64", "64.5"), "w and h"),
        (frame(OPENGL[1]).replace("\"w\"", "\"camera_model\":\"OPENCV_FISHEYE\",\"w\""), "FISHEYE"),
        (frame(OPENGL[1]).replace("\"w\"", "\"cx\":3,\"w\""), "cx and cy"),
        (frame(OPENGL[1]).replace("\"w\"", "\"is_fisheye\":true,\"k1\":0.1,\"w\""), "fisheye"),
        (frame(OPENGL[1]).replace("\"w\"", "\"k4\":0.1,\"w\""), "fisheye"),
    ] {
        std::fs::write(&json, text).unwrap();
        refused(&json, part);
    }
    let alone = tempfile::tempdir().unwrap();
    let path = tum(alone.path(), "1 2 3");
    assert!(read(&path).unwrap_err().to_string().contains("fx fy cx cy"));
    std::fs::write(alone.path().join("intrinsics.txt"), "1 1 3 4").unwrap();
    std::fs::write(&path, "1 2 3").unwrap();
    refused(&path, "line 1: eight numbers");
    std::fs::remove_file(alone.path().join("intrinsics.txt")).unwrap();
    refused(&path, "the lens of a trajectory");
    refused(&at("cameras.yaml", ""), "TUM");
}

#[test]
fn binary_models_cut_short_or_changed_never_panic() {
    let dir = tempfile::tempdir().unwrap();
    colmap_binary(dir.path());
    for name in ["cameras.bin", "images.bin"] {
        let path = dir.path().join(name);
        let whole = std::fs::read(&path).unwrap();
        for end in 0..whole.len() {
            std::fs::write(&path, &whole[..end]).unwrap();
            // Of the images' last points none need to be read.
            assert!(read(dir.path()).is_err(), "{name} {end}");
        }
        for at in 0..whole.len() {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xff;
            std::fs::write(&path, bytes).unwrap();
            let _ = read(dir.path());
        }
        std::fs::write(&path, whole).unwrap();
    }
}

#[test]
fn cameras_for_other_pictures_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    colmap_text(dir.path(), "PINHOLE", "500 510 320 240");
    let given = read(dir.path()).unwrap();
    let refuse = |frames: Vec<PlannedFrame>| match_cameras(&given, &plan(frames)).unwrap_err().to_string();
    let message = refuse(vec![frame(0, "in/c.jpg", None), frame(1, "in/d.jpg", None)]);
    assert!(message.contains("1 of 2") && message.contains("d.jpg") && message.contains("images.txt"), "{message}");
    let turned = PlannedFrame { width: 240, height: 320, ..frame(0, "c.jpg", None) };
    assert!(refuse(vec![turned]).contains("640x480 and this one has 240x320"));
    // One camera for two pictures.
    let message = refuse(vec![frame(0, "left/c.jpg", None), frame(1, "right/c.jpg", None)]);
    assert!(message.contains("left/c.jpg and right/c.jpg"), "{message}");
    // Another ending is the same picture, another folder as well, unless two fit.
    assert!(match_cameras(&given, &plan(vec![frame(0, "elsewhere/c.png", None)])).is_ok());
    let mut doubled = given.clone();
    let mut other = doubled.cameras[1].clone();
    other.picture = PictureKey::Name("right/c.jpg".to_owned());
    doubled.cameras.push(other);
    doubled.cameras[1].picture = PictureKey::Name("left/c.jpg".to_owned());
    let found = |path: &str| match_cameras(&doubled, &plan(vec![frame(0, path, None)]));
    assert!(found("in/right/c.jpg").is_ok());
    assert!(found("in/c.jpg").unwrap_err().to_string().contains("alike"));
    // Times that are not near.
    let path = tum(dir.path(), "500 510 319.5 239.5");
    let times = read(&path).unwrap();
    let message = match_cameras(&times, &plan(vec![frame(0, "10.05.png", None)])).unwrap_err().to_string();
    assert!(message.contains("its time in seconds"), "{message}");
}

/// Lines on a plane, seen through a lens that bends them, are straight again.
#[test]
fn undistorted_lines_are_straight() {
    let lens = Lens {
        focal: [100.0, 100.0],
        centre: Some([60.0, 45.0]),
        distortion: Distortion { radial: [-0.2, 0.03, 0.0, 0.0, 0.0, 0.0], tangential: [0.002, -0.001] },
    };
    // White beyond the plane x = 0.3, as the bent lens sees it: each of its pixels' directions by iteration.
    let mut data = Vec::new();
    for row in 0..90 {
        for column in 0..120 {
            let seen = [(f64::from(column) + 0.5 - 60.0) / 100.0, (f64::from(row) + 0.5 - 45.0) / 100.0];
            let mut straight = seen;
            for _ in 0..50 {
                let bent = lens.distortion.apply(straight);
                straight = [0, 1].map(|axis| straight[axis] + seen[axis] - bent[axis]);
            }
            data.extend([if straight[0] > 0.3 { 255u8 } else { 0 }; 3]);
        }
    }
    let straight = lens.undistort(&Picture::new(120, 90, data));
    // The edge is at column 60 + 100 * 0.3 in every row.
    for row in 10..80 {
        let line = &straight.data[row * 360..][..360];
        let edge = (0..120).find(|column| line[3 * column] > 127).unwrap();
        assert!((89..=91).contains(&edge), "row {row}: {edge}");
    }
    let none = Lens { distortion: Distortion::default(), ..lens };
    let picture = Picture::new(120, 90, (0..120 * 90 * 3).map(|v| (v % 251) as u8).collect());
    assert_eq!(none.undistort(&picture), picture);
}
