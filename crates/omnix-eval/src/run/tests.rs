//! A network that knows the answer, in half the unit, over data sets that are written here; and data sets that are not whole.

use std::fs;
use std::io::Cursor;
use std::path::Path;

use omnix_data::{Dense, Flag, Motion, Sample, SampleParts, Set, Time, Unit, sets};
use omnix_geometry::Camera;

use super::*;
use crate::EvalError;
use crate::clips::ClipRule;
use crate::depth::Alignment;
use crate::files::npz::tests::write as npz;
use crate::kinds::depth::DepthSet;
use crate::kinds::pose::PoseSet;
use crate::kinds::tapvid3d::Options;
use crate::table::Report;

const SIZE: [u32; 2] = [28, 14];
const PIXELS: usize = 28 * 14;
const FOCAL: f64 = 20.0;
/// What the network's lengths are of the true ones.
const UNIT: f64 = 0.5;

/// Where the camera is in frame k; it looks along z at a wall at z = 6.
fn position(k: usize) -> [f64; 3] {
    let k = k as f64;
    [0.2 * k, 0.03 * k * k, 0.1 * k]
}

fn depth_of(k: usize) -> f64 {
    6.0 - position(k)[2]
}

/// Where the point of a pixel of frame `source` is in frame `time`: the right half of a picture goes up.
fn point(source: usize, time: usize, pixel: usize) -> [f64; 3] {
    let (z, c) = (depth_of(source), position(source));
    let at = |k: usize, side: u32| (k as f64 + 0.5 - f64::from(side) / 2.0) / FOCAL * z;
    let up = if moves(pixel) { 0.05 * (time as f64 - source as f64) } else { 0.0 };
    [at(pixel % 28, SIZE[0]) + c[0], at(pixel / 28, SIZE[1]) + c[1] - up, 6.0]
}

fn moves(pixel: usize) -> bool {
    pixel % 28 >= 14
}

fn camera(k: usize, unit: f64) -> Camera {
    let [x, y, z] = position(k).map(|v| (-v * unit) as f32);
    let focal = FOCAL as f32;
    Camera {
        extrinsics: [[1.0, 0.0, 0.0, x], [0.0, 1.0, 0.0, y], [0.0, 0.0, 1.0, z]],
        intrinsics: [[focal, 0.0, 14.0], [0.0, focal, 7.0], [0.0, 0.0, 1.0]],
    }
}

/// The number of a frame is its brightness.
fn grey(k: usize) -> u8 {
    8 * k as u8 + 4
}

/// Knows everything, and keeps the frames that it saw last.
#[derive(Default)]
struct Oracle {
    frames: Vec<usize>,
    clips: usize,
    has_no_paths: bool,
    breaks: bool,
}

impl Network for Oracle {
    fn name(&self) -> String {
        "oracle".to_owned()
    }

    fn size(&self, _: [u32; 2]) -> [u32; 2] {
        SIZE
    }

    fn has_paths(&self) -> bool {
        !self.has_no_paths
    }

    fn see(&mut self, clip: &Clip) -> Result<Seen, EvalError> {
        if self.breaks {
            return Err(EvalError::Run("the device was lost".into()));
        }
        assert_eq!(clip.size, SIZE);
        self.clips += 1;
        self.frames = clip.pictures.iter().map(|picture| usize::from(picture.data[0] / 8)).collect();
        let depths = self.frames.iter().flat_map(|&k| vec![(depth_of(k) * UNIT) as f32; PIXELS]);
        Ok(Seen { depth: depths.collect(), cameras: self.frames.iter().map(|&k| camera(k, UNIT)).collect() })
    }

    fn paths(&mut self, image: usize, pixels: Option<&[[u32; 2]]>) -> Result<Vec<[f32; 3]>, EvalError> {
        let all: Vec<[u32; 2]> = (0..PIXELS as u32).map(|k| [k % 28, k / 28]).collect();
        let pixels = pixels.unwrap_or(&all);
        let source = self.frames[image];
        let of = |&time: &usize| {
            let at = move |&[x, y]: &[u32; 2]| point(source, time, (y * 28 + x) as usize);
            pixels.iter().map(at).map(|p| p.map(|v| (v * UNIT) as f32)).collect::<Vec<_>>()
        };
        Ok(self.frames.iter().flat_map(of).collect())
    }
}

fn picture(path: &Path, k: usize) {
    fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::RgbImage::from_pixel(56, 28, image::Rgb([grey(k); 3])).save(path).unwrap();
}

/// A scene of one video of `frames` frames in the shared layout, with tracks through the pixels of the first.
fn scene(dir: &Path, frames: usize) {
    let maps = |of: &dyn Fn(usize, usize) -> f64| -> Vec<f32> {
        (0..frames * PIXELS).map(|i| of(i / PIXELS, i % PIXELS) as f32).collect()
    };
    let positions = (0..frames * frames * PIXELS).map(|i| {
        let (source, time, pixel) = (i / PIXELS / frames, i / PIXELS % frames, i % PIXELS);
        point(source, time, pixel).map(|v| v as f32)
    });
    let sample = Sample::new(SampleParts {
        size: SIZE,
        images: (0..frames).flat_map(|k| vec![grey(k); PIXELS * 3]).collect(),
        times: (0..frames as u32).map(|k| Time { frame: k, moment: k, ..Time::default() }).collect(),
        cameras: (0..frames).map(|k| camera(k, 1.0)).collect(),
        depth: Some(maps(&|k, _| depth_of(k))),
        moving: Some((0..frames * PIXELS).map(|i| Flag::from(moves(i % PIXELS))).collect()),
        motion: Motion::Dense(Dense {
            positions: positions.collect(),
            visible: Some(vec![Flag::Yes; frames * frames * PIXELS]),
        }),
        unit: Unit::Metre,
    });
    let points: Vec<(usize, usize)> = (0..PIXELS).map(|pixel| (0, pixel)).collect();
    sets::shared::write(&sample.unwrap(), dir, &points).unwrap();
}

fn scenes(folder: &Path) -> SceneData<'_> {
    SceneData { folder, set: None }
}

#[track_caller]
fn row<'a>(report: &'a Report, name: &str) -> &'a [f64] {
    let row = report.rows.iter().find(|row| row.name.contains(name));
    &row.unwrap_or_else(|| panic!("no {name} in {:?}", report.rows)).values
}

fn quiet(_: u64, _: u64) {}

const PAIRS: ClipRule = ClipRule::Contiguous(4);

#[test]
fn scenes_give_depth_cameras_and_trajectories() {
    let dir = tempfile::tempdir().unwrap();
    scene(&dir.path().join("a"), 9);
    scene(&dir.path().join("b"), 3);
    let mut oracle = Oracle::default();
    let data = DepthData::Scenes(scenes(dir.path()));
    let found = depth(&mut oracle, data, PAIRS, &Alignment::ALL, None, &mut quiet).unwrap();
    assert!(row(&found, ", scale")[0] < 1e-5 && (row(&found, "metric")[0] - 0.5).abs() < 1e-6, "{:?}", found.rows);
    // Two clips of four frames, one frame left over; three frames are no clip.
    assert_eq!((oracle.clips, found.sequences.len()), (2, 1));
    assert!(found.notes.iter().any(|n| n.contains("1 of 9 frames fill no clip")), "{:?}", found.notes);
    assert!(found.skipped[0].name.starts_with("b/") && found.skipped[0].reason.contains("fill no clip"));
    assert!(found.notes[0].contains("oracle") && found.protocol.clips.contains('4'), "{found:?}");

    let found = pose(&mut oracle, PoseData::Scenes(scenes(dir.path())), PAIRS, None, &mut quiet).unwrap();
    assert!(found.rows[0].values.iter().all(|v| *v < 1e-5), "{:?}", found.rows);
    assert_eq!((found.sequences[0].count, found.skipped.len()), (8, 1));

    // The tracks are those of the pixels of the first frame, so one clip has them all.
    let four = tempfile::tempdir().unwrap();
    scene(&four.path().join("c"), 4);
    let inputs = INPUTS.map(str::to_owned);
    let found = trajectories(&mut oracle, scenes(four.path()), PAIRS, &inputs, None, &mut quiet).unwrap();
    let [apd, epe, _] = row(&found, "first image, ALL, one scale per image") else { panic!() };
    assert!(*apd == 1.0 && *epe < 1e-5, "{:?}", found.rows);
    assert!(row(&found, "first image, FG, as if nothing moved")[1] > 0.01, "{:?}", found.rows);
    let found = trajectories(&mut oracle, scenes(dir.path()), PAIRS, &inputs, None, &mut quiet).unwrap();
    assert!(found.notes.iter().any(|n| n.starts_with("4 frames of videos fill no clip")), "{:?}", found.notes);
    let reasons: Vec<&str> = found.skipped.iter().map(|s| s.reason.as_str()).collect();
    assert_eq!(reasons.iter().filter(|r| r.contains("1 camera(s)")).count(), 2, "{reasons:?}");
    assert!(reasons.iter().any(|r| r.contains("TooFew") || r.contains("a sample of 4 images")), "{reasons:?}");
}

#[test]
fn benchmarks_of_depth_are_run_with_their_pictures() {
    let dir = tempfile::tempdir().unwrap();
    let deep = |path: &Path, level: f64| {
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_pixel(56, 28, image::Luma([level.round() as u16]))
            .save(path)
            .unwrap();
    };
    let kitti = dir.path().join("kitti");
    for k in 0..4 {
        for drive in ["a", "b"] {
            deep(&kitti.join(format!("{drive}/proj_depth/groundtruth/image_02/{k:010}.png")), depth_of(k) * 256.0);
        }
        picture(&kitti.join(format!("a/image_02/data/{k:010}.png")), k);
        picture(&kitti.join(format!("b/image_02/data/{:010}.png", k + 1)), k);
        deep(&dir.path().join(format!("bonn/x/depth_110/{k}.0.png")), depth_of(k) * 5000.0);
        picture(&dir.path().join(format!("bonn/x/rgb_110/{k}.1.png")), k);
    }
    let run = |set, folder: &str| {
        let path = dir.path().join(folder);
        let data = DepthData::Benchmark(&path, set);
        depth(&mut Oracle::default(), data, ClipRule::Whole, &[Alignment::Scale], None, &mut quiet)
    };
    let found = run(DepthSet::Kitti, "kitti").unwrap();
    assert!(found.rows[0].values[0] < 1e-3 && found.sequences.len() == 1, "{found:?}");
    assert!(found.skipped[0].reason.contains("no picture 0000000000.png"), "{:?}", found.skipped);
    assert!(run(DepthSet::Bonn, "bonn").unwrap().rows[0].values[0] < 1e-3);
    fs::remove_file(dir.path().join("bonn/x/rgb_110/0.1.png")).unwrap();
    let error = run(DepthSet::Bonn, "bonn").unwrap_err().to_string();
    assert!(error.contains("3 pictures for 4 depth maps"), "{error}");
    assert!(matches!(run(DepthSet::Sintel, "kitti"), Err(EvalError::NoSequences { .. })));
}

#[test]
fn benchmarks_of_cameras_are_run_with_their_pictures() {
    let dir = tempfile::tempdir().unwrap();
    let (tum, sintel) = (dir.path().join("tum"), dir.path().join("sintel"));
    let (mut list, mut truth) = (String::from("# pictures\n"), String::new());
    for k in 0..10 {
        picture(&tum.join(format!("x/rgb/{k}.png")), k);
        list += &format!("{k}.000 rgb/{k}.png\n");
        let [x, y, z] = position(k);
        truth += &format!("{k}.001 {x} {y} {z} 0 0 0 1\n");
        picture(&sintel.join(format!("final/y/frame_{k:04}.png")), k);
        let own = camera(k, 1.0);
        let numbers = own.intrinsics.iter().flatten().chain(own.extrinsics.iter().flatten());
        let mut bytes = 202_021.25f32.to_le_bytes().to_vec();
        bytes.extend(numbers.flat_map(|v| f64::from(*v).to_le_bytes()));
        let path = sintel.join(format!("camdata_left/y/frame_{k:04}.cam"));
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, bytes).unwrap();
    }
    fs::write(tum.join("x/rgb.txt"), list).unwrap();
    fs::write(tum.join("x/groundtruth.txt"), truth).unwrap();
    let run = |set, folder: &Path, rule| {
        pose(&mut Oracle::default(), PoseData::Benchmark(folder, set), rule, None, &mut quiet)
    };
    // Every third picture.
    let found = run(PoseSet::Tum, &tum, ClipRule::Whole).unwrap();
    assert!(found.rows[0].values.iter().all(|v| *v < 1e-5) && found.sequences[0].count == 4, "{found:?}");
    let found = run(PoseSet::Sintel, &sintel, ClipRule::Uniform(4)).unwrap();
    assert!(found.rows[0].values.iter().all(|v| *v < 1e-5) && found.sequences[0].count == 4, "{found:?}");
    assert!(matches!(run(PoseSet::Plain, &tum, ClipRule::Whole), Err(EvalError::Parameter { .. })));
}

#[test]
fn tracks_are_asked_for_where_they_are_seen_first() {
    let dir = tempfile::tempdir().unwrap();
    let frames = 5;
    // Pixels of the network; the last of them is not visible in the first frame.
    let tracks = [150, 151, 100, 200, 330];
    let jpeg = |k: usize| {
        let mut bytes = Cursor::new(Vec::new());
        let picture = image::RgbImage::from_pixel(56, 28, image::Rgb([grey(k); 3]));
        picture.write_to(&mut bytes, image::ImageFormat::Jpeg).unwrap();
        bytes.into_inner()
    };
    let pictures: Vec<Vec<u8>> = (0..frames).map(jpeg).collect();
    let longest = pictures.iter().map(Vec::len).max().unwrap();
    let padded = pictures.iter().flat_map(|p| p.iter().copied().chain(std::iter::repeat(0)).take(longest));
    let floats = |values: Vec<f64>| values.into_iter().flat_map(|v| (v as f32).to_le_bytes()).collect::<Vec<u8>>();
    let seen = |t: usize, pixel: usize| {
        let (p, c) = (point(0, t, pixel), position(t));
        [p[0] - c[0], p[1] - c[1], p[2] - c[2]]
    };
    let points = floats((0..frames).flat_map(|t| tracks.map(|p| seen(t, p)).concat()).collect());
    let visible: Vec<u8> = (0..frames * 5).map(|i| u8::from(i != 4)).collect();
    let queries =
        floats(tracks.iter().flat_map(|p| [(2 * (p % 28) + 1) as f64, (2 * (p / 28) + 1) as f64, 0.0]).collect());
    let kind = format!("|S{longest}");
    npz(
        &dir.path().join("x.npz"),
        &[
            ("images_jpeg_bytes", kind.as_str(), "(5,)", padded.collect()),
            ("tracks_XYZ", "<f4", "(5, 5, 3)", points),
            ("visibility", "|b1", "(5, 5)", visible),
            ("queries_xyt", "<f4", "(5, 3)", queries),
            ("fx_fy_cx_cy", "<f4", "(4,)", floats(vec![40.0, 40.0, 28.0, 14.0])),
        ],
    );
    let mut oracle = Oracle::default();
    let mut done = Vec::new();
    let rule = |rule| Options { clips: vec![rule], ..Options::default() };
    let found =
        tapvid3d(&mut oracle, dir.path(), &rule(ClipRule::Contiguous(4)), &mut |k, n| done.push((k, n))).unwrap();
    let [apd, jaccard, _, epe] = found.rows[0].values[..] else { panic!() };
    assert!(apd == 1.0 && epe < 1e-4 && jaccard == 1.0, "{:?}", found.rows);
    assert!(found.notes.iter().any(|n| n.contains("1 frames fill no clip")) && done == [(1, 1)], "{:?}", found.notes);
    // In the whole sequence the fifth track is asked for too.
    let found = tapvid3d(&mut oracle, dir.path(), &rule(ClipRule::Whole), &mut quiet).unwrap();
    assert!(found.rows[0].values[0] == 1.0 && found.rows[0].values[2] < 1.0, "{:?}", found.rows);
    oracle.has_no_paths = true;
    let error = tapvid3d(&mut oracle, dir.path(), &rule(PAIRS), &mut quiet).unwrap_err();
    assert!(error.to_string().contains("oracle"), "{error}");
}

#[test]
fn what_is_not_whole_is_named_and_a_broken_network_ends_it() {
    let dir = tempfile::tempdir().unwrap();
    scene(&dir.path().join("a"), 4);
    scene(&dir.path().join("b"), 4);
    scene(&dir.path().join("c"), 4);
    fs::remove_file(dir.path().join("b/depths/00002.exr")).unwrap();
    fs::remove_file(dir.path().join("c/intrinsics.npy")).unwrap();
    let data = || DepthData::Scenes(scenes(dir.path()));
    let mut oracle = Oracle::default();
    let found = depth(&mut oracle, data(), PAIRS, &[Alignment::Scale], None, &mut quiet).unwrap();
    let reasons: Vec<String> = found.skipped.iter().map(|s| format!("{}: {}", s.name, s.reason)).collect();
    assert!(reasons[0].starts_with("b/") && reasons[0].contains("00002.exr"), "{reasons:?}");
    assert!(reasons[1].starts_with("c: ") && reasons[1].contains("intrinsics.npy"), "{reasons:?}");
    let found = depth(&mut oracle, data(), PAIRS, &[Alignment::Scale], Some(1), &mut quiet).unwrap();
    assert!(found.notes.iter().any(|n| n.contains("1 of 3 sequences")) && found.sequences.len() == 1);
    let wrong = SceneData { folder: dir.path(), set: Some(Set::Ue) };
    let error = pose(&mut oracle, PoseData::Scenes(wrong), PAIRS, None, &mut quiet).unwrap_err().to_string();
    assert!(error.contains("no scene of ue, but of shared"), "{error}");
    let unknown = ["both".to_owned()];
    let error = trajectories(&mut oracle, scenes(dir.path()), PAIRS, &unknown, None, &mut quiet).unwrap_err();
    assert!(matches!(error, EvalError::Parameter { .. }), "{error}");
    oracle.breaks = true;
    let error = depth(&mut oracle, data(), PAIRS, &[Alignment::Scale], None, &mut quiet).unwrap_err();
    assert!(matches!(error, EvalError::Run(_)) && error.to_string().contains("device was lost"), "{error}");
    let error = pose(&mut oracle, PoseData::Scenes(scenes(dir.path())), PAIRS, None, &mut quiet).unwrap_err();
    assert!(matches!(error, EvalError::Run(_)), "{error}");
    let inputs = ["monocular".to_owned()];
    let error = trajectories(&mut oracle, scenes(dir.path()), PAIRS, &inputs, None, &mut quiet).unwrap_err();
    assert!(matches!(error, EvalError::Run(_)), "{error}");
}
