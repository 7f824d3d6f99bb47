//! Answers that are right, scaled, still or wrong, to samples whose truth is written down here.

use omnix_data::{Dense, Flag, Sample, SampleParts, Time, Unit};
use omnix_geometry::Camera;

use super::{Answer, Figures, Motion, Score, Trivial, score};

const SIDE: usize = 14;
const PIXELS: usize = SIDE * SIDE;
const COUNT: usize = 3;

/// Looks along z from a place on the x axis.
fn camera(x: f32) -> Camera {
    let focal = SIDE as f32;
    let extrinsics = [[1.0, 0.0, 0.0, -x], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    Camera { extrinsics, intrinsics: [[focal, 0.0, focal / 2.0], [0.0, focal, focal / 2.0], [0.0, 0.0, 1.0]] }
}

/// A wall that comes nearer towards the last row; the first two rows go up by `step` from image to image.
fn sample(step: f32) -> Sample {
    let cameras: Vec<Camera> = (0..COUNT).map(|k| camera(0.2 * k as f32)).collect();
    let depth_at = |pixel: usize| 4.0 - 0.1 * (pixel / SIDE) as f32;
    let mut positions = Vec::new();
    for source in 0..COUNT {
        for time in 0..COUNT {
            positions.extend((0..PIXELS).map(|pixel| {
                let z = depth_at(pixel);
                let at = |k: usize| (k as f32 + 0.5 - SIDE as f32 / 2.0) / SIDE as f32 * z;
                let gone = if pixel / SIDE < 2 { step * (time as f32 - source as f32) } else { 0.0 };
                [at(pixel % SIDE) + 0.2 * source as f32, at(pixel / SIDE) - gone, z]
            }));
        }
    }
    let moving = |i: usize| Flag::from(step != 0.0 && i % PIXELS / SIDE < 2);
    Sample::new(SampleParts {
        size: [SIDE as u32; 2],
        images: vec![0; COUNT * PIXELS * 3],
        times: (0..COUNT as u32).map(|k| Time { frame: k, moment: k, ..Time::default() }).collect(),
        cameras,
        depth: Some((0..COUNT * PIXELS).map(|i| depth_at(i % PIXELS)).collect()),
        moving: Some((0..COUNT * PIXELS).map(moving).collect()),
        motion: omnix_data::Motion::Dense(Dense { positions, visible: None }),
        unit: Unit::Metre,
    })
    .unwrap()
}

/// Depth, cameras, positions and scores of an answer.
type Owned = (Vec<f32>, Vec<Camera>, Vec<[f32; 3]>, Vec<f32>);

/// The truth as an answer, all lengths times `scale`.
fn answer(sample: &Sample, scale: f32) -> Owned {
    let parts = sample.clone().into_parts();
    let omnix_data::Motion::Dense(dense) = parts.motion else { panic!("no paths") };
    let mut cameras = parts.cameras;
    cameras.iter_mut().for_each(|camera| camera.extrinsics.iter_mut().for_each(|row| row[3] *= scale));
    let theta = parts.moving.unwrap().iter().map(|flag| if *flag == Flag::Yes { 0.9 } else { 0.1 }).collect();
    let positions = dense.positions.iter().map(|p| p.map(|v| v * scale)).collect();
    (parts.depth.unwrap().iter().map(|z| z * scale).collect(), cameras, positions, theta)
}

fn scored(sample: &Sample, (depth, cameras, positions, theta): &Owned) -> (Score, [Score; 3]) {
    let motion = Some(Motion { positions, theta });
    score(sample, &Answer { depth, cameras, motion }).unwrap()
}

#[test]
fn the_truth_in_another_unit_is_perfect() {
    let sample = sample(0.3);
    let (own, trivial) = scored(&sample, &answer(&sample, 0.37));
    assert!(own.abs_rel < 1e-6 && own.delta == 1.0, "{own:?}");
    assert!(own.displacement[0] < 1e-5 * own.displacement[1], "{own:?}");
    assert_eq!(own.overlap, [3 * 28, 3 * 28]);
    assert!(own.still.is_nan() && own.rotation < 1e-3 && own.direction < 1e-3, "{own:?}");
    let still = trivial[Trivial::NothingMoves as usize];
    assert_eq!((still.displacement[0], still.overlap), (own.displacement[1], [0, 3 * 28]));
    assert!((still.direction - 90.0).abs() < 1e-9);
    // Depth is a plane over rows here, and no constant.
    assert!(trivial[Trivial::Rows as usize].abs_rel < 1e-5);
    assert!(trivial[Trivial::Constant as usize].abs_rel > 0.05);
}

#[test]
fn each_fault_shows_in_its_own_figure() {
    let sample = sample(0.3);
    let truth = answer(&sample, 1.0);
    let (right, _) = scored(&sample, &truth);

    let mut half = truth.clone();
    for (i, place) in half.2.iter_mut().enumerate() {
        let own = (i / PIXELS / COUNT) * (COUNT + 1) * PIXELS + i % PIXELS;
        place[1] = (place[1] + truth.2[own][1]) / 2.0;
    }
    let (found, _) = scored(&sample, &half);
    assert!((found.displacement[0] / found.displacement[1] - 0.5).abs() < 1e-5, "{found:?}");
    assert_eq!((found.abs_rel, found.overlap), (right.abs_rel, right.overlap));

    let mut all = truth.clone();
    all.3.fill(0.9);
    let (found, _) = scored(&sample, &all);
    assert_eq!((found.overlap, found.abs_rel), ([3 * 28, 3 * 196], right.abs_rel));

    let mut deeper = truth.clone();
    deeper.0[..PIXELS].iter_mut().for_each(|z| *z *= 1.5);
    let (found, _) = scored(&sample, &deeper);
    assert!(found.abs_rel > 0.1 && found.delta < 0.7 && found.rotation == right.rotation, "{found:?}");

    let mut aside = truth;
    aside.1[2].extrinsics[2][3] -= 0.4;
    let (found, _) = scored(&sample, &aside);
    assert!(found.direction > 10.0 && found.rotation == right.rotation && found.abs_rel == right.abs_rel, "{found:?}");
}

#[test]
fn a_still_scene_counts_what_goes_too_far() {
    let sample = sample(0.0);
    let mut truth = answer(&sample, 1.0);
    assert_eq!(scored(&sample, &truth).0.still, 0.0);
    // Row 5 of image 1 goes off at time 2.
    let start = (COUNT + 2) * PIXELS + 5 * SIDE;
    truth.2[start..start + SIDE].iter_mut().for_each(|place| place[0] += 0.5);
    let (found, _) = scored(&sample, &truth);
    assert!((found.still - 14.0 / (3.0 * 196.0)).abs() < 1e-12, "{found:?}");
    assert_eq!(found.displacement, [0.0; 2]);
}

#[test]
fn sums_and_means_of_samples_stand_in_the_report() {
    let (moving, still) = (sample(0.3), sample(0.0));
    let mut figures = Figures::default();
    figures.add("moving", scored(&moving, &answer(&moving, 1.0)));
    figures.add("still", scored(&still, &answer(&still, 1.0)));
    figures.skip("gone", "no such file".to_owned());
    let report = figures.report("made".to_owned(), "ours").unwrap();
    assert_eq!((report.rows[0].count, report.rows[0].name.as_str(), report.skipped.len()), (2, "ours", 1));
    let columns: Vec<&str> = report.columns.iter().map(|column| column.name).collect();
    assert_eq!(columns, ["AbsRel", "delta_1.25", "displacement", "IoU", "still", "rotation", "direction"]);
    let values = &report.rows[0].values;
    assert!(values[2] < 1e-5 && values[3] == 1.0 && values[4] == 0.0, "{values:?}");
    assert_eq!(report.rows[3].values[2], 1.0);
    assert!(report.rows[1].values[2].is_nan() && report.sequences[1].values[2].is_nan());
    assert!(report.to_markdown().contains("best plane over rows"));
    let nothing = Figures::default().report("made".to_owned(), "ours").unwrap_err().to_string();
    assert!(nothing.contains("no sample"), "{nothing}");
}

#[test]
fn answers_of_another_size_are_refused() {
    let sample = sample(0.3);
    let (depth, cameras, positions, theta) = answer(&sample, 1.0);
    let refused = |answer: Answer<'_>| score(&sample, &answer).unwrap_err().to_string();
    assert!(refused(Answer { depth: &depth[1..], cameras: &cameras, motion: None }).contains("depths of an answer"));
    assert!(refused(Answer { depth: &depth, cameras: &cameras[1..], motion: None }).contains("cameras of an answer"));
    let motion = Some(Motion { positions: &positions[1..], theta: &theta });
    assert!(refused(Answer { depth: &depth, cameras: &cameras, motion }).contains("positions of an answer"));
}
