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
    scene_at(&truth.join("a"), 3, |_| [f32::NAN; 3]);
    let error = evaluate(&predicted, &truth).unwrap_err().to_string();
    assert!(error.contains("no pixel of its source images"), "{error}");
    std::fs::write(truth.join("a/000001.npz"), b"nothing").unwrap();
    assert!(evaluate(&predicted, &truth).unwrap_err().to_string().contains("NPZ"));
    assert!(matches!(evaluate(&predicted, dir.path().join("predicted/none").as_path()), Err(EvalError::Read { .. })));
}
