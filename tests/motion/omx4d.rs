//! `omx4d` byte for byte against files of the public fork's own tools.

use std::{fs, path::Path};

use omnix_io::{
    Picture,
    output::{
        Omx4dOptions, VoxelOptions,
        motion::{ImageTime, MotionView, MovingPoints},
        write_omx4d,
    },
};
use safetensors::SafeTensors;

use crate::made;

fn data(name: &str) -> Vec<u8> {
    fs::read(Path::new(env!("CARGO_MANIFEST_DIR")).join("data/omx4d").join(name)).unwrap()
}

fn floats(tensors: &SafeTensors<'_>, name: &str) -> Vec<f32> {
    tensors.tensor(name).unwrap().data().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

const VIEWS: usize = 3;
const WIDTH: usize = 20;
const HEIGHT: usize = 14;
const PIXELS: usize = WIDTH * HEIGHT;

/// The golden's prediction, every pixel a point, and its cameras-to-world.
fn prediction() -> (MovingPoints, Vec<[[f32; 4]; 3]>) {
    let (predictions, pictures) = (data("predictions.safetensors"), data("rgb.safetensors"));
    let tensors = SafeTensors::deserialize(&predictions).unwrap();
    let pictures = SafeTensors::deserialize(&pictures).unwrap();
    let rgb = pictures.tensor("rgb").unwrap().data().to_vec();
    let (poses, lenses) = (floats(&tensors, "camera_pose"), floats(&tensors, "intrinsics"));
    let trajectory = floats(&tensors, "trajectory");
    let camera_to_world =
        (0..VIEWS).map(|v| std::array::from_fn(|i| std::array::from_fn(|j| poses[12 * v + 4 * i + j]))).collect();
    let view = |v: usize| MotionView {
        // Not what the golden is made of: its cameras are given from camera to world.
        extrinsics: [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]],
        intrinsics: std::array::from_fn(|i| std::array::from_fn(|j| lenses[9 * v + 3 * i + j])),
        time: ImageTime { video: 0, frame: v as u32, time_s: None },
        picture: Picture::new(WIDTH as u32, HEIGHT as u32, rgb[3 * v * PIXELS..][..3 * PIXELS].to_vec()),
    };
    let count = VIEWS * PIXELS;
    let at = |t: usize, i: usize| {
        let from = 3 * ((i / PIXELS * VIEWS + t) * PIXELS + i % PIXELS);
        [trajectory[from], trajectory[from + 1], trajectory[from + 2]]
    };
    let points = MovingPoints {
        views: (0..VIEWS).map(view).collect(),
        source: (0..count).map(|i| (i / PIXELS) as u32).collect(),
        pixel: (0..count).map(|i| [(i % WIDTH) as u32, (i % PIXELS / WIDTH) as u32]).collect(),
        positions: (0..VIEWS).flat_map(|t| (0..count).flat_map(move |i| at(t, i))).collect(),
        colours: rgb.chunks_exact(3).map(|c| [c[0], c[1], c[2]]).collect(),
        motion: floats(&tensors, "pts3d_dynamic_score"),
        confidence: vec![1.0; count],
        moving: vec![true; count],
    };
    (points, camera_to_world)
}

fn assert_same(written: &[u8], golden: &[u8]) {
    let header = |b: &[u8]| String::from_utf8_lossy(&b[16..1416.min(b.len())]).into_owned();
    assert_eq!(header(written), header(golden));
    let differing: Vec<usize> = (0..golden.len().min(written.len())).filter(|&i| written[i] != golden[i]).collect();
    assert_eq!((written.len(), differing), (golden.len(), vec![]));
}

#[test]
fn palette_is_byte_equal() {
    let dir = tempfile::tempdir().unwrap();
    let (points, camera_to_world) = prediction();
    let voxel = VoxelOptions::default().budget(200);
    let options = Omx4dOptions::default().voxel(voxel).palette(true).camera_to_world(Some(camera_to_world));
    let path = write_omx4d(&dir.path().join("a.omx4d"), "palette", 12.0, &points, &options).unwrap();
    assert_same(&fs::read(path).unwrap(), &data("palette.omx4d"));
}

#[test]
fn pictures_threshold_and_padded_views_are_byte_equal() {
    let dir = tempfile::tempdir().unwrap();
    let (points, camera_to_world) = prediction();
    let voxel = VoxelOptions::default().budget(333).reserve(0.25).threshold(0.6);
    let options = Omx4dOptions::default().voxel(voxel).candidate_views(Some(2)).camera_to_world(Some(camera_to_world));
    let path = write_omx4d(&dir.path().join("a.omx4d"), "rgb", 24.0, &points, &options).unwrap();
    assert_same(&fs::read(path).unwrap(), &data("rgb.omx4d"));
}

#[test]
fn cameras_are_inverted_and_infinite_points_left_out() {
    let dir = tempfile::tempdir().unwrap();
    let mut points = made::points(3, 1);
    let at_time_1 = points.len();
    points.positions[3 * (at_time_1 + 5)] = f32::INFINITY;
    points.motion[0] = f32::NAN;
    let path =
        write_omx4d(&dir.path().join("a.omx4d"), "made \"up\"", 10.0, &points, &Omx4dOptions::default()).unwrap();
    let bytes = fs::read(path).unwrap();
    let length = u32::from_le_bytes(bytes[12..16].try_into().unwrap()) as usize;
    let header: serde_json::Value = serde_json::from_slice(&bytes[16..16 + length]).unwrap();
    assert_eq!(header["name"], "made \"up\"");
    assert_eq!(header["pointCount"], 3 * made::PIXELS - 2);
    let at = header["attributes"]["cameraPose"]["offset"].as_u64().unwrap() as usize;
    let pose = |i: usize| f32::from_le_bytes(bytes[at + 64 + 4 * i..][..4].try_into().unwrap());
    // View 1: the product of B pose B and B w2c B is the identity.
    let axes = [1.0, -1.0, -1.0];
    for (i, row) in points.views[1].extrinsics.iter().enumerate() {
        for j in 0..4 {
            let last = if j == 3 { row[3] * axes[i] } else { 0.0 };
            let sum: f32 = (0..3).map(|k| axes[i] * row[k] * axes[k] * pose(4 * k + j)).sum::<f32>() + last;
            assert!((sum - f32::from(i == j)).abs() < 1e-6, "{i} {j} {sum}");
        }
    }
}
