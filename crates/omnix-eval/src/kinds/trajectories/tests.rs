//! Scenes made here, and runs that are scaled, moved, still, or broken.

use super::*;
use crate::files::npz::tests::write;

const SIZE: [usize; 2] = [4, 2];
const TIMES: usize = 3;

fn f32s(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

/// A scene: pixel 0 of each image moves by 0.5 m at each time; `of` changes every point.
fn scene_at(dir: &Path, images: usize, of: impl Fn([f32; 3]) -> [f32; 3]) {
    std::fs::create_dir_all(dir).unwrap();
    let [width, height] = SIZE;
    for image in 0..images {
        let point = |k: usize| {
            let (time, pixel) = (k / (width * height), k % (width * height));
            let x = if pixel == 0 { 0.5 * time as f32 } else { 0.0 };
            of([x + (pixel % width) as f32, (pixel / width) as f32, 4.0])
        };
        let points = f32s((0..TIMES * width * height).flat_map(point));
        let poses = f32s((0..TIMES).flat_map(|_| [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]));
        let intrinsics = f32s((0..TIMES).flat_map(|_| [4.0, 0.0, 2.0, 0.0, 4.0, 1.0, 0.0, 0.0, 1.0]));
        let moving: Vec<u8> = (0..width * height).map(|pixel| u8::from(pixel == 0)).collect();
        write(
            &dir.join(format!("{image:06}.npz")),
            &[
                ("trajectory", "<f4", "(3, 2, 4, 3)", points),
                ("extrinsics", "<f4", "(3, 3, 4)", poses),
                ("intrinsics", "<f4", "(3, 3, 3)", intrinsics),
                ("moving", "|b1", "(2, 4)", moving),
            ],
        );
    }
}

fn row<'a>(report: &'a Report, name: &str) -> &'a Row {
    report.rows.iter().find(|row| row.name == name).unwrap()
}

#[test]
fn a_scaled_copy_is_perfect_and_would_not_be_without_motion() {
    let dir = tempfile::tempdir().unwrap();
    let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
    scene_at(&truth.join("a"), 3, |p| p);
    scene_at(&predicted.join("a/exports/tracks"), 3, |p| p.map(|v| v / 2.0));
    let report = evaluate(&predicted, &truth).unwrap();
    for name in ["all images, ALL, one scale per image", "first image, FG, one scale per scene"] {
        let row = row(&report, name);
        assert!(row.values[0] == 1.0 && row.values[1] < 1e-6, "{row:?}");
    }
    let still = row(&report, "all images, FG, as if nothing moved, one scale per image");
    assert!(still.values[1] > 0.3, "{still:?}");
    assert_eq!((report.sequences.len(), report.skipped.len()), (1, 0));
}

#[test]
fn groups_have_means_and_what_is_missing_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
    for name in ["monocular/a", "pairs/a", "pairs/b", "pairs/c"] {
        scene_at(&truth.join(name), 3, |p| p);
    }
    scene_at(&predicted.join("monocular/a"), 3, |p| p);
    scene_at(&predicted.join("pairs/a"), 2, |[x, y, z]| [x, y, z * if x > 1.5 { 2.0 } else { 1.0 }]);
    std::fs::create_dir_all(predicted.join("pairs/b")).unwrap();
    let report = evaluate(&predicted, &truth).unwrap();
    let name = "all images, ALL, one scale per image";
    assert!(row(&report, name).values[1] > 0.1);
    assert_eq!(row(&report, &format!("monocular: {name}")).values[0], 1.0);
    assert_eq!(report.skipped.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["pairs/b", "pairs/c"]);
    assert!(report.notes.iter().any(|n| n.contains("1 of 3 source images have no prediction")), "{:?}", report.notes);
}

#[test]
fn broken_truth_and_other_counts_are_said() {
    let dir = tempfile::tempdir().unwrap();
    let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
    scene_at(&truth.join("a"), 2, |p| p);
    scene_at(&predicted.join("a"), 3, |p| p);
    let error = evaluate(&predicted, &truth).unwrap_err().to_string();
    assert!(error.contains("2 archives of 3 images"), "{error}");
    scene_at(&truth.join("a"), 3, |p| p);
    std::fs::copy(predicted.join("a/000002.npz"), predicted.join("a/000007.npz")).unwrap();
    let error = evaluate(&predicted, &truth).unwrap_err().to_string();
    assert!(error.contains("images: the prediction has 8 and the truth 3"), "{error}");
    std::fs::remove_file(predicted.join("a/000007.npz")).unwrap();
    scene_at(&truth.join("a"), 3, |_| [f32::NAN; 3]);
    let error = evaluate(&predicted, &truth).unwrap_err().to_string();
    assert!(error.contains("no pixel of its source images"), "{error}");
    std::fs::write(truth.join("a/000001.npz"), b"nothing").unwrap();
    assert!(evaluate(&predicted, &truth).unwrap_err().to_string().contains("NPZ"));
    assert!(matches!(evaluate(&predicted, dir.path().join("predicted/none").as_path()), Err(EvalError::Read { .. })));
}

/// A scene of a data set: one video of `frames` images of the truth above, seen by cameras that stand still.
fn scene_on_disk(dir: &Path, frames: usize) {
    use omnix_data::{Dense, Flag, Motion, SampleParts, Time, Unit};

    let (pixels, count) = (SIZE[0] * SIZE[1], frames as u32);
    let point = |pixel: usize, time: usize| {
        let x = if pixel == 0 { 0.5 * time as f32 } else { 0.0 };
        // The centre of the pixel at a depth of 4 m, with a focal length of 4 pixels.
        [x + (pixel % SIZE[0]) as f32 + 0.5 - 2.0, (pixel / SIZE[0]) as f32 + 0.5 - 1.0, 4.0]
    };
    let positions = (0..frames * frames * pixels).map(|i| point(i % pixels, i / pixels % frames)).collect::<Vec<_>>();
    let camera = omnix_geometry::Camera {
        extrinsics: omnix_geometry::IDENTITY_POSE,
        intrinsics: [[4.0, 0.0, 2.0], [0.0, 4.0, 1.0], [0.0, 0.0, 1.0]],
    };
    let sample = Sample::new(SampleParts {
        size: SIZE.map(|side| side as u32),
        images: vec![0; frames * pixels * 3],
        times: (0..count).map(|k| Time { frame: k, moment: k, ..Time::default() }).collect(),
        cameras: vec![camera; frames],
        depth: Some(vec![4.0; frames * pixels]),
        moving: Some((0..frames * pixels).map(|i| Flag::from(i % pixels == 0)).collect()),
        motion: Motion::Dense(Dense { positions, visible: Some(vec![Flag::Yes; frames * frames * pixels]) }),
        unit: Unit::Metre,
    });
    let points: Vec<(usize, usize)> = (0..pixels).map(|pixel| (0, pixel)).collect();
    omnix_data::sets::shared::write(&sample.unwrap(), dir, &points).unwrap();
}

#[test]
fn scenes_of_a_data_set_are_truth() {
    let dir = tempfile::tempdir().unwrap();
    let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
    for name in ["a", "b", "c"] {
        scene_on_disk(&truth.join(name), TIMES);
    }
    let run = |of: &dyn Fn([f32; 3]) -> [f32; 3], place: &str| scene_at(&predicted.join(place), 1, of);
    // The run has pixel positions at the corner of a pixel; it is moved by half a pixel and the middle of the picture, and scaled.
    let right = |[x, y, z]: [f32; 3]| [x - 1.5, y - 0.5, z].map(|v| v / 2.0);
    run(&right, "a/video 0/exports/tracks");
    run(&right, "b");
    let report = evaluate(&predicted, &truth).unwrap();
    let name = "first image, ALL, one scale per image";
    assert!(row(&report, name).values[0] == 1.0 && row(&report, name).values[1] < 1e-5, "{report:?}");
    assert_eq!(report.sequences.iter().map(|s| s.name.as_str()).collect::<Vec<_>>(), ["a/video 0", "b/video 0"]);
    assert!(report.skipped[0].name == "c/video 0" && report.skipped[0].reason.contains("no prediction"));
    let still = row(&report, "first image, FG, as if nothing moved, one scale per image");
    assert!(still.values[1] > 0.1, "{still:?}");
    // A scene that lost a file has no result, and says which.
    std::fs::remove_file(truth.join("a/moving/00001.png")).unwrap();
    let report = evaluate(&predicted, &truth).unwrap();
    assert!(report.skipped[0].reason.contains("00001.png"), "{:?}", report.skipped);
}
