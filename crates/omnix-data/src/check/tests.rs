//! Every fault planted into a scene that is right otherwise, and found; and right scenes in which nothing is found.

use std::path::Path;

use glam::{DMat3, DVec3};
use omnix_geometry::Camera;

use super::*;
use crate::rigid::Rigid;
use crate::{Dense, SampleParts, Tracks, Unit, made};

const SIZE: [u32; 2] = [84, 56];

/// A video with its depth and masks, and its paths if wanted.
fn scene(paths: bool) -> Sample {
    let sample = made::video(SIZE, 5);
    if paths {
        return sample;
    }
    let mut parts = sample.into_parts();
    parts.motion = Motion::Unknown;
    Sample::new(parts).unwrap()
}

fn with_cameras(sample: &Sample, change: impl Fn(Pinhole) -> Pinhole) -> Sample {
    let mut parts = sample.clone().into_parts();
    parts.cameras = parts.cameras.iter().map(|camera: &Camera| change(Pinhole::new(camera)).to_camera()).collect();
    Sample::new(parts).unwrap()
}

fn kinds(sample: &Sample) -> Vec<&'static str> {
    check(sample, Path::new("scene")).problems.iter().map(|problem| problem.kind).collect()
}

/// The fault is found by depth alone, and with paths.
#[track_caller]
fn finds(kind: &str, words: &str, change: impl Fn(Pinhole) -> Pinhole) {
    for paths in [false, true] {
        let report = check(&with_cameras(&scene(paths), &change), Path::new("scene"));
        let found = report.problems.iter().find(|problem| problem.kind == kind);
        let found = found.unwrap_or_else(|| panic!("paths {paths}: {:?} {:?}", report.problems, report.warp));
        assert!(found.text.contains(words), "{}", found.text);
    }
}

#[test]
fn right_scenes_have_no_problems() {
    for sample in [scene(false), scene(true)] {
        let report = check(&sample, Path::new("scene"));
        assert_eq!(report.problems, []);
        let warp = report.warp.unwrap();
        assert!(warp.told && warp.median < 1e-5 && warp.in_front < 0.01 && warp.overlap > 0.7, "{warp:?}");
        assert!(report.rotations.error < 1e-6 && report.rotations.mirrored == 0);
    }
    let report = check(&scene(true), Path::new("scene"));
    let tracks = report.tracks.unwrap();
    assert!(tracks.most < 0.01 && tracks.depth_median.unwrap() < 1e-5 && tracks.still_but_moving == 0, "{tracks:?}");
    let visibility = report.visibility.unwrap();
    assert!(visibility.compared > 10_000 && visibility.contradictions == 0, "{visibility:?}");
    assert_eq!(report.counts.depth_known, Some(1.0));
}

#[test]
fn a_flipped_axis() {
    let flip = |camera: Pinhole, sign: [f64; 3]| {
        let m = DMat3::from_diagonal(DVec3::from(sign));
        Pinhole { w2c: Rigid { rotation: m * camera.w2c.rotation, translation: m * camera.w2c.translation }, ..camera }
    };
    finds("flipped_axis", "x right, y up, z forward, which mirrors", |camera| flip(camera, [1.0, -1.0, 1.0]));
    finds("camera_axes", "x right, y up, z back (OpenGL, Blender)", |camera| flip(camera, [1.0, -1.0, -1.0]));
    finds("flipped_axis", "mirrored along the world's x axis", |camera| {
        let mut centre = camera.w2c.inverse().translation;
        centre.x = -centre.x;
        Pinhole { w2c: Rigid { translation: -(camera.w2c.rotation * centre), ..camera.w2c }, ..camera }
    });
}

#[test]
fn a_transposed_rotation() {
    finds("transposed_rotation", "translations beside them are right", |camera| Pinhole {
        w2c: Rigid { rotation: camera.w2c.rotation.transpose(), ..camera.w2c },
        ..camera
    });
    finds("transposed_rotation", "positions of the cameras beside them are right", |camera| {
        let c2w = camera.w2c.inverse();
        let wrong = Rigid { rotation: c2w.rotation.transpose(), ..c2w };
        Pinhole { w2c: wrong.inverse(), ..camera }
    });
    finds("inverted_poses", "invert them", |camera| Pinhole { w2c: camera.w2c.inverse(), ..camera });
}

#[test]
fn axes_of_a_body_in_north_east_down() {
    finds("ned_axes", "x forward, y right, z down (NED)", |camera| {
        let to_ned = DMat3::from_cols(DVec3::Z, DVec3::X, DVec3::Y).transpose();
        let w2c = Rigid { rotation: to_ned * camera.w2c.rotation, translation: to_ned * camera.w2c.translation };
        Pinhole { w2c, ..camera }
    });
}

#[test]
fn a_doubled_focal_length() {
    finds("focal_length", "times as long", |camera| Pinhole { focal: camera.focal.map(|f| f * 2.0), ..camera });
    let wrong = with_cameras(&scene(false), |camera| Pinhole { focal: camera.focal.map(|f| f * 2.0), ..camera });
    let report = check(&wrong, Path::new("scene"));
    let text = &report.problems.iter().find(|problem| problem.kind == "focal_length").unwrap().text;
    let factor: f64 = text.split_whitespace().find_map(|word| word.parse().ok()).unwrap();
    assert!((factor - 2.0).abs() < 0.05, "{text}");
}

#[test]
fn a_shifted_principal_point() {
    finds("principal_point", "further right", |camera| Pinhole {
        principal: [camera.principal[0] - 12.0, camera.principal[1] + 5.0],
        ..camera
    });
}

#[test]
fn paths_in_another_world() {
    let mut parts = scene(true).into_parts();
    if let Motion::Dense(dense) = &mut parts.motion {
        dense.positions.iter_mut().for_each(|p| *p = [p[0], -p[2], p[1]]);
    }
    let report = check(&Sample::new(parts).unwrap(), Path::new("scene"));
    let kinds: Vec<_> = report.problems.iter().map(|problem| problem.kind).collect();
    assert!(kinds.contains(&"world_axes") && kinds.contains(&"reprojection"), "{:?}", report.problems);
}

#[test]
fn noise_without_a_cause_is_said_to_disagree() {
    let mut parts = scene(false).into_parts();
    for (index, z) in parts.depth.as_mut().unwrap().iter_mut().enumerate() {
        *z *= 1.0 + 0.3 * ((index as f32 * 12.9898).sin() * 43_758.547).fract().abs();
    }
    let found = kinds(&Sample::new(parts).unwrap());
    assert!(found.contains(&"warp"), "{found:?}");
}

#[test]
fn visibility_that_contradicts_depth() {
    let mut parts = scene(true).into_parts();
    let Motion::Dense(Dense { visible: Some(visible), .. }) = &mut parts.motion else { panic!("no visibility") };
    // All of the last image's points hidden at their own time, and all others visible.
    let map = (SIZE[0] * SIZE[1]) as usize;
    visible.fill(Flag::Yes);
    visible[24 * map..].fill(Flag::No);
    let report = check(&Sample::new(parts).unwrap(), Path::new("scene"));
    let found = report.visibility.unwrap();
    assert!(found.outside > 100 && found.behind > 100 && found.hidden > 500, "{found:?}");
    assert_eq!(report.problems.iter().map(|p| p.kind).collect::<Vec<_>>(), ["visibility"]);
}

#[test]
fn masks_that_contradict_paths() {
    let mut parts = scene(true).into_parts();
    parts.moving.as_mut().unwrap().fill(Flag::No);
    let report = check(&Sample::new(parts).unwrap(), Path::new("scene"));
    assert!(report.tracks.unwrap().still_but_moving > 100);
    assert!(report.problems.iter().any(|problem| problem.kind == "moving_mask"));
}

#[test]
fn tracks_off_by_half_a_pixel_show_their_offset() {
    let truth = scene(true);
    let (count, pixels) = (truth.count(), truth.pixels());
    let mut tracks = Tracks { count: pixels, pixels: Some(Vec::new()), ..Tracks::default() };
    for time in 0..count {
        let positions = truth.positions(0, time).unwrap();
        tracks.positions.extend(positions);
        tracks.visible.extend(truth.visible(0, time).unwrap());
        // In whole numbers, as many data sets count.
        let whole = |p: &[f32; 3]| omnix_geometry::project(*p, &truth.cameras()[time], crate::PIXEL);
        tracks.pixels.as_mut().unwrap().extend(positions.iter().map(whole).map(|[u, v, _]| [u, v]));
    }
    let mut parts = truth.into_parts();
    parts.motion = Motion::Tracks(tracks);
    let report = check(&Sample::new(parts).unwrap(), Path::new("scene"));
    let [right, down] = report.tracks.unwrap().offset;
    assert!((right - 0.5).abs() < 1e-3 && (down - 0.5).abs() < 1e-3, "{right} {down}");
    assert_eq!(report.problems, []);
}

#[test]
fn still_cameras_tell_nothing() {
    let views: Vec<_> = (0..3).map(|f| (made::time(0, f), made::camera(SIZE, [0.0; 3], [0.0; 2]))).collect();
    let mut parts = made::sample(SIZE, &views).into_parts();
    parts.motion = Motion::Unknown;
    let report = check(&Sample::new(parts).unwrap(), Path::new("scene"));
    assert!(!report.warp.unwrap().told && report.problems.is_empty());
}

#[test]
fn images_are_chosen_from_several_videos() {
    let dir = tempfile::tempdir().unwrap();
    let views: Vec<_> =
        (0..4).flat_map(|v| (0..6).map(move |f| (made::time(v, f), made::path([28, 14], v, f)))).collect();
    crate::sets::shared::write(&made::sample([28, 14], &views), dir.path(), &[(0, 3), (5, 60)]).unwrap();
    let scene = crate::sets::open(dir.path(), None).unwrap();
    let picks = choose(scene.as_ref(), 9);
    assert_eq!(
        picks.iter().map(|p| (p.video, p.frame)).collect::<Vec<_>>(),
        [(0, 0), (0, 2), (0, 4), (1, 0), (1, 2), (1, 4), (2, 0), (2, 2), (2, 4)]
    );
    let (_, report) = check_scene(scene.as_ref(), &CheckOptions::default()).unwrap();
    assert_eq!((report.set, report.counts.all_images, report.counts.tracks), ("shared", 24, Some(2)));
    assert_eq!(report.problems, []);
}

/// A sheet at z = 2 before a camera at the origin, one beside it and one behind the sheet; the points of the first image's pixels
/// as tracks, which the first two see and the third does not, unless the second is told not to.
fn sheet(second: Flag) -> Sample {
    let front = made::camera(SIZE, [0.0; 3], [0.0; 2]);
    let beside = made::camera(SIZE, [0.1, 0.0, 0.0], [0.0; 2]);
    let turned =
        Rigid { rotation: DMat3::from_rotation_y(std::f64::consts::PI), translation: DVec3::new(0.0, 0.0, 4.0) };
    let cameras = [front, beside, Pinhole { w2c: turned.inverse(), ..front }];
    let pixels = (SIZE[0] * SIZE[1]) as usize;
    let points: Vec<[f32; 3]> = (0..pixels)
        .map(|pixel| {
            let [u, v] = crate::rigid::centre(pixel, SIZE[0] as usize);
            front.unproject(u, v, 2.0).as_vec3().to_array()
        })
        .collect();
    let parts = SampleParts {
        size: SIZE,
        images: vec![0; 3 * 3 * pixels],
        times: (0..3).map(|video| made::time(video, 0)).collect(),
        cameras: cameras.iter().map(|camera| camera.to_camera()).collect(),
        depth: Some(vec![2.0; 3 * pixels]),
        moving: None,
        motion: Motion::Tracks(Tracks {
            count: pixels,
            positions: points.repeat(3),
            visible: [Flag::Yes, second, Flag::No].into_iter().flat_map(|flag| vec![flag; pixels]).collect(),
            pixels: None,
        }),
        unit: Unit::Metre,
    };
    Sample::new(parts).unwrap()
}

#[test]
fn the_front_of_a_sheet_is_hidden_from_behind_it() {
    let seen = |second| check(&sheet(second), Path::new("scene")).visibility.unwrap();
    let found = seen(Flag::Yes);
    assert_eq!((found.behind, found.hidden), (0, 0), "{found:?}");
    assert!(found.compared > 500, "{found:?}");
    // From the same side nothing hides it.
    let found = seen(Flag::No);
    assert!(found.hidden > 200, "{found:?}");
}
