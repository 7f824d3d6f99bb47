//! `tracks`, `st4rtrack` and `masks`.

use std::{fs, path::Path};

use npyz::npz::NpzArchive;
use omnix_io::{
    Export,
    output::{MotionInput, MotionOptions, MotionStream, motion::SourceMotion, write_motion},
};

use crate::made::{self, HEIGHT, PIXELS, WIDTH, moves, position};

fn array<T: npyz::Deserialize>(path: &Path, name: &str) -> (Vec<u64>, Vec<T>) {
    let mut archive = NpzArchive::open(path).unwrap();
    let array = archive.by_name(name).unwrap().unwrap_or_else(|| panic!("no array {name}"));
    (array.shape().to_vec(), array.into_vec().unwrap())
}

fn npy(path: &Path) -> (Vec<u64>, Vec<f32>) {
    let file = npyz::NpyFile::new(fs::File::open(path).unwrap()).unwrap();
    (file.shape().to_vec(), file.into_vec().unwrap())
}

#[test]
fn names() {
    let list = Export::parse_list("tracks,st4rtrack-omx4d,masks,glb,npz").unwrap();
    let needs: Vec<bool> = list.iter().map(|e| e.needs_motion()).collect();
    assert_eq!(needs, [true, true, true, true, false, false]);
    assert_eq!(Export::Glb.motion_input(), Some(MotionInput::Points));
    assert_eq!(Export::Masks.motion_input(), Some(MotionInput::Images));
    assert_eq!(Export::Npz.motion_input(), None);
}

#[test]
fn tracks_of_chosen_points() {
    let dir = tempfile::tempdir().unwrap();
    let points = made::points(4, 7);
    let files = write_motion(&[Export::Tracks], &points, dir.path(), &MotionOptions::default()).unwrap();
    assert_eq!(files.len(), 4);
    assert_eq!(files[2], dir.path().join("exports/tracks/000002.npz"));
    let (shape, trajectory) = array::<f32>(&files[2], "trajectory");
    assert_eq!(shape, [4, 7, 3]);
    assert_eq!(trajectory[3 * (7 + 4)..][..3], position(2, 28, 1));
    let (shape, pixel) = array::<i32>(&files[2], "pixel");
    assert_eq!((shape.as_slice(), &pixel[8..10]), (&[7, 2][..], &[4, 3][..]));
    assert_eq!(array::<f32>(&files[2], "theta").1[4], made::score(28));
    let gates: Vec<bool> = (0..7).map(|i| moves(7 * i)).collect();
    assert_eq!(array::<bool>(&files[2], "moving").1, gates);
    assert_eq!(array::<i32>(&files[2], "video").1, [0, 0, 1, 0]);
    let times = array::<f64>(&files[2], "times").1;
    assert!(times[1].is_nan() && times[3] == 0.3, "{times:?}");
    let (shape, extrinsics) = array::<f32>(&files[2], "extrinsics");
    assert_eq!((shape.as_slice(), extrinsics[12 * 3 + 3]), (&[4, 3, 4][..], -0.75));
    assert_eq!(array::<u8>(&files[2], "rgb").0, [7, 3]);
}

/// Every pixel of one image, as the stream takes it.
struct Dense {
    points: Vec<f32>,
    trajectory: Vec<f32>,
    confidence: Vec<f32>,
    motion: Vec<f32>,
    moving: Vec<bool>,
}

impl Dense {
    fn new(index: usize, times: usize) -> Self {
        let at = |t: usize| (0..PIXELS).flat_map(move |p| position(index, p, t));
        Self {
            points: at(index).collect(),
            trajectory: (0..times).flat_map(at).collect(),
            confidence: (0..PIXELS).map(|p| 1.0 + 0.01 * p as f32).collect(),
            motion: (0..PIXELS).map(made::score).collect(),
            moving: (0..PIXELS).map(moves).collect(),
        }
    }

    fn image(&self, index: usize, trajectory: bool) -> SourceMotion<'_> {
        SourceMotion {
            index,
            pixels: None,
            points: &self.points,
            trajectory: trajectory.then_some(&self.trajectory),
            confidence: &self.confidence,
            motion: &self.motion,
            moving: &self.moving,
        }
    }
}

#[test]
fn stream_of_whole_images() {
    let dir = tempfile::tempdir().unwrap();
    let list = [Export::St4rtrack, Export::Masks];
    let mut stream = MotionStream::open(&list, made::views(3), dir.path()).unwrap();
    assert!(stream.wants_trajectory(0) && !stream.wants_trajectory(1));
    for index in 0..3 {
        let mut dense = Dense::new(index, 3);
        (dense.motion[1], dense.points[3]) = (f32::NAN, f32::NAN);
        stream.image(&dense.image(index, index == 0)).unwrap();
    }
    assert_eq!(stream.finish().len(), 12 + 6);
    let folder = dir.path().join("exports/st4rtrack");
    let (shape, head1) = npy(&folder.join("pts3d1_p2.npy"));
    assert_eq!(shape, [u64::from(HEIGHT), u64::from(WIDTH), 6]);
    assert_eq!(head1[6 * 27..][..3], position(0, 27, 2));
    assert_eq!(head1[6 * 27 + 3], 135.0 / 255.0);
    let (_, head2) = npy(&folder.join("pts3d2_p2.npy"));
    assert_eq!(head2[6 * 27..][..3], position(2, 27, 2));
    assert_eq!(head2[6..9], [0.0; 3], "a NaN would hide the scene in the viewer");
    let (shape, trust) = npy(&folder.join("conf2_p2.npy"));
    assert_eq!((shape.as_slice(), trust[1], trust[2]), (&[6, 8][..], 0.0, 1.02));

    let image::DynamicImage::ImageLuma8(mask) = image::open(dir.path().join("masks/000001.png")).unwrap() else {
        panic!("not 8-bit grey")
    };
    assert!(mask.as_raw().iter().enumerate().all(|(p, &v)| v == if moves(p) { 255 } else { 0 }));
    let image::DynamicImage::ImageLuma16(theta) = image::open(dir.path().join("theta/000001.png")).unwrap() else {
        panic!("not 16-bit grey")
    };
    assert_eq!((theta.as_raw()[1], theta.as_raw()[2]), (0, 131));
}

#[test]
fn tracks_of_whole_images() {
    let dir = tempfile::tempdir().unwrap();
    let mut stream = MotionStream::open(&[Export::Tracks], made::views(3), dir.path()).unwrap();
    assert!(stream.wants_trajectory(2));
    stream.image(&Dense::new(1, 3).image(1, true)).unwrap();
    let files = stream.finish();
    let (shape, trajectory) = array::<f32>(&files[0], "trajectory");
    assert_eq!(shape, [3, 6, 8, 3]);
    assert_eq!(trajectory[3 * (2 * PIXELS + 30)..][..3], position(1, 30, 2));
    assert_eq!(array::<u8>(&files[0], "rgb").0, [6, 8, 3]);
    assert!(NpzArchive::open(&files[0]).unwrap().array_names().all(|name| name != "pixel"));
}
