//! A model of made cameras, read back by the reader of known cameras (another file's code) and compared with what went in.

use super::*;
use crate::cameras::{self, PictureKey};
use crate::output::Export;
use crate::output::export::open_sinks;
use crate::output::frame::SourcePicture;
use crate::output::options::SinkOptions;
use crate::preprocess::Framing;

const WIDTH: u32 = 84;
const HEIGHT: u32 = 56;
const INTRINSICS: [[f32; 3]; 3] = [[70.0, 0.0, 42.0], [0.0, 72.0, 28.0], [0.0, 0.0, 1.0]];

/// Cameras that move along x before a wall at z = 2, upright, the second turned by a little.
fn pose(index: usize) -> [[f32; 4]; 3] {
    let turn = 0.1 * index as f32;
    let (c, s) = (turn.cos(), turn.sin());
    [[c, 0.0, -s, -0.3 * index as f32], [0.0, 1.0, 0.0, 0.1], [s, 0.0, c, 0.0]]
}

/// Depth of the wall as camera `index` sees it; with a cube before it in the first image alone.
fn depth(index: usize) -> Vec<f32> {
    let camera = Camera::new(pose(index), INTRINSICS).unwrap();
    let (rotation, centre) = camera.camera_to_world();
    let at = |pixel: u32| {
        let (u, v) = (pixel % WIDTH, pixel / WIDTH);
        if index == 0 && (30..50).contains(&u) && (20..40).contains(&v) {
            return 1.0;
        }
        let ray = rotation * camera.ray(f64::from(u), f64::from(v));
        ((2.0 - centre.z) / ray.z) as f32
    };
    (0..WIDTH * HEIGHT).map(at).collect()
}

fn write(dir: &Path, images: usize) {
    let framing = Framing { resized: (112, 56), crop: [14, 0, WIDTH, HEIGHT] };
    let rgb: Vec<u8> = (0..3 * WIDTH * HEIGHT).map(|v| v as u8).collect();
    let mut sinks = open_sinks(&[Export::Colmap, Export::Transforms], dir, &SinkOptions::default()).unwrap();
    for index in 0..images {
        let (depth, name) = (depth(index), format!("picture {index}.jpg"));
        let result = FrameResult {
            index,
            video: 0,
            frame: index as u32,
            time_s: None,
            width: WIDTH,
            height: HEIGHT,
            depth: &depth,
            confidence: None,
            rgb: &rgb,
            extrinsics: Some(pose(index)),
            intrinsics: Some(INTRINSICS),
            sky: None,
            gaussians: None,
            features: &[],
            source: Some(SourcePicture { name: &name, size: [448, 224], framing }),
        };
        sinks.iter_mut().for_each(|sink| sink.frame(&result).unwrap());
    }
    for sink in sinks {
        sink.finish(&RunSummary::default()).unwrap();
    }
}

#[test]
fn both_forms_and_transforms_hold_the_cameras() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), 3);
    for path in [BINARY, TEXT, "transforms.json"] {
        let read = cameras::read(&dir.path().join(path)).unwrap();
        assert_eq!(read.cameras.len(), 3);
        for (index, camera) in read.cameras.iter().enumerate() {
            assert_eq!(camera.picture, PictureKey::Name(format!("picture {index}.jpg")));
            assert_eq!((camera.size, camera.lens.focal), (Some([448, 224]), [280.0, 288.0]), "{path}");
            // (42 + 14) * 4 across, 28 * 4 down.
            assert_eq!(camera.lens.centre, Some([224.0, 112.0]));
            let expected = pose(index);
            let off = camera.world_to_camera.as_flattened().iter().zip(expected.as_flattened());
            assert!(off.map(|(a, b)| (a - b).abs()).fold(0.0, f32::max) < 1e-6, "{path} {index}");
        }
    }
}

/// Numbers of the lines of a text file that are no comments.
fn lines(path: &Path) -> Vec<Vec<f64>> {
    let text = std::fs::read_to_string(path).unwrap();
    let numbers = |line: &str| line.split(' ').filter_map(|field| field.parse().ok()).collect();
    text.lines().filter(|line| !line.starts_with('#')).map(numbers).collect()
}

#[test]
fn points_are_where_two_images_agree_and_tracks_lead_back() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), 3);
    let text = dir.path().join(TEXT);
    let (images, points) = (lines(&text.join("images.txt")), lines(&text.join("points3D.txt")));
    assert!(points.len() > 500, "{}", points.len());
    for point in &points {
        let [_, x, y, z, _, _, _, error, ref track @ ..] = point[..] else { panic!("{point:?}") };
        // On the wall: the cube is seen by one image alone.
        assert!((z - 2.0).abs() < 1e-4 && error == 0.0, "{point:?}");
        assert!(track.len() >= 4, "{point:?}");
        for pair in track.chunks(2) {
            let seen = &images[2 * (pair[0] as usize - 1) + 1][3 * pair[1] as usize..][..3];
            assert_eq!(seen[2], point[0]);
            let index = pair[0] as usize - 1;
            let at = Camera::new(pose(index), INTRINSICS).unwrap().to_camera(DVec3::new(x, y, z));
            // In pixels of the source picture: four times as many.
            let (u, v) = ((70.0 * at.x / at.z + 42.0 + 14.0) * 4.0, (72.0 * at.y / at.z + 28.0) * 4.0);
            assert!((u - seen[0]).abs() < 1e-2 && (v - seen[1]).abs() < 1e-2, "{point:?} {seen:?} {u} {v}");
        }
    }
    // Every observation belongs to a point.
    let observations: usize = images.iter().skip(1).step_by(2).map(|line| line.len() / 3).sum();
    assert_eq!(observations, points.iter().map(|point| (point.len() - 8) / 2).sum::<usize>());
}

#[test]
fn a_single_image_keeps_its_points_and_none_leaves_no_file() {
    let dir = tempfile::tempdir().unwrap();
    write(dir.path(), 1);
    let points = lines(&dir.path().join(TEXT).join("points3D.txt"));
    assert!(points.iter().any(|point| (point[3] - 1.0).abs() < 1e-6) && points.len() > 500);
    let nothing = tempfile::tempdir().unwrap();
    write(nothing.path(), 0);
    assert_eq!(std::fs::read_dir(nothing.path()).unwrap().count(), 0);
}
