//! `glb` of a run with motion: `scene.glb` with points that move.
//!
//! * "moving points": one primitive of those that the gate lets move, at the first key time, with one morph target for each further key
//!   time (positions relative to the first). The weights' animation (LINEAR) is 1 for one target at its key and falls to 0 towards
//!   the neighbouring keys, so between keys two neighbours blend, which moves every point in a straight line.
//! * "static points": a second primitive without targets.
//! * "frusta": the lines of every image's camera. For every video a camera node "camera of video v" (glTF perspective camera of its
//!   first image's intrinsics, principal point in the middle) with the frustum lines as its mesh, animated through its images.
//!
//! Key times are those of the images, image i at i / fps seconds; with more images than `max_times`, evenly chosen ones with the
//! first and the last.
//! Axes and centre are those of the still `scene.glb` (first camera in glTF axes, origin at the median at the first key time).
//! Points that are not finite at a key time are left out; more than `max_points` are thinned evenly, static ones first.
//!
//! Size in bytes, K key times: about `20 static + (20 + 12 (K − 1)) moving + 320 images`; 200,000 points that all move at 32 times:
//! 78 MB. `max_points` is lowered where that passes 3 GiB.

use std::path::{Path, PathBuf};

use glam::{DMat3, DQuat, DVec3};
use serde_json::json;

use super::{
    atomic::AtomicFile,
    camera::Camera,
    glb_layout::{camera_colour, frustum, placement, rows},
    gltf::{LINES, MAX_BYTES, POINT_BYTES, POINTS, Scene, TARGET_BYTES, TO_GLTF},
    motion::MovingPoints,
    options::{GlbMotionOptions, check_rate},
    voxel::midpoints,
};
use crate::IoError;

/// Name of the export in errors.
const EXPORT: &str = "glb";

/// Writes the file `path`. Without an image there is nothing to write.
///
/// # Errors
/// Points that are no pixels of the images; cameras that cannot be inverted; a frame rate that is not positive; a failure of
/// writing.
pub fn write_glb_motion(
    path: &Path,
    fps: f64,
    points: &MovingPoints,
    options: &GlbMotionOptions,
) -> Result<Option<PathBuf>, IoError> {
    points.check(EXPORT)?;
    check_rate(fps)?;
    let mut cameras = Vec::with_capacity(points.views.len());
    for (index, view) in points.views.iter().enumerate() {
        let missing = IoError::MissingField { export: EXPORT, missing: "an invertible camera", index };
        cameras.push(Camera::new(view.extrinsics, view.intrinsics).ok_or(missing)?);
    }
    let Some(&first) = cameras.first() else { return Ok(None) };
    let keys = key_times(points.views.len(), options.max_times);
    let (moving, still) = choose(points, &keys, options.max_points);
    let world = |time: usize, point: usize| {
        first.to_camera(DVec3::from_array(points.position(time, point).map(f64::from))) * TO_GLTF
    };
    let at_first: Vec<DVec3> = moving.iter().chain(&still).map(|&i| world(keys[0], i)).collect();
    let (median, distance) = placement(&at_first);
    let place = |time: usize, ids: &[usize]| -> Vec<DVec3> { ids.iter().map(|&i| world(time, i) - median).collect() };
    let colours = |ids: &[usize]| -> Vec<[u8; 3]> { ids.iter().map(|&i| points.colours[i]).collect() };
    let seconds = |times: &[usize]| -> Vec<f32> { times.iter().map(|&t| (t as f64 / fps) as f32).collect() };

    let mut scene = Scene::default();
    let base = place(keys[0], &moving);
    let targets: Vec<Vec<[f32; 3]>> = keys[1..]
        .iter()
        .map(|&time| place(time, &moving).iter().zip(&base).map(|(p, b)| (*p - *b).as_vec3().to_array()).collect())
        .collect();
    if let Some(node) = scene.add("moving points", POINTS, &base, &colours(&moving), &targets)
        && !targets.is_empty()
    {
        let weights: Vec<f32> = (0..keys.len())
            .flat_map(|key| (1..keys.len()).map(move |target| if target == key { 1.0 } else { 0.0 }))
            .collect();
        let input = scene.keys(&seconds(&keys));
        scene.animate(node, "weights", input, "SCALAR", &weights);
    }
    scene.add("static points", POINTS, &place(keys[0], &still), &colours(&still), &[]);
    if options.show_cameras {
        let to_scene = |p: DVec3| first.to_camera(p) * TO_GLTF - median;
        add_cameras(&mut scene, points, &cameras, distance, to_scene, seconds);
    }
    let extras = json!({
        "axes": "glTF: x right, y up, z backward of the first image's camera; origin at the points' median",
        "unit": options.unit,
        "median_in_first_camera_gltf_axes": median.to_array(),
        "first_camera_world_to_camera": rows(first),
        "frames_per_second": fps,
        "key_images": keys,
        "moving_points": moving.len(),
        "static_points": still.len(),
    });
    let mut file = AtomicFile::create(path.to_owned())?;
    scene.write(&mut file, extras)?;
    Ok(Some(file.commit()?))
}

/// Images whose times are keys: all, or `max` evenly chosen ones.
fn key_times(images: usize, max: usize) -> Vec<usize> {
    let count = images.min(max.max(2));
    if count < 2 {
        return (0..count).collect();
    }
    (0..count).map(|j| (j * (images - 1) + (count - 1) / 2) / (count - 1)).collect()
}

/// Moving and static points that are finite at all keys, together at most `max` and within the size that a file may have.
fn choose(points: &MovingPoints, keys: &[usize], max: usize) -> (Vec<usize>, Vec<usize>) {
    let most = MAX_BYTES / (POINT_BYTES + TARGET_BYTES * (keys.len() - 1));
    let max = max.min(most);
    let finite = |i: &usize| keys.iter().all(|&t| points.position(t, *i).iter().all(|v| v.is_finite()));
    let (moving, still): (Vec<usize>, Vec<usize>) = (0..points.len()).filter(finite).partition(|&i| points.moving[i]);
    let moving = midpoints(&moving, max);
    let still = midpoints(&still, max - moving.len());
    (moving, still)
}

/// The lines of every camera, and a moving camera for each video.
fn add_cameras(
    scene: &mut Scene,
    points: &MovingPoints,
    cameras: &[Camera],
    distance: f64,
    to_scene: impl Fn(DVec3) -> DVec3,
    seconds: impl Fn(&[usize]) -> Vec<f32>,
) {
    let count = cameras.len();
    let size = |i: usize| (points.views[i].picture.width, points.views[i].picture.height);
    let lines: Vec<DVec3> = (0..count)
        .flat_map(|i| frustum(cameras[i], size(i), distance).map(|p| to_scene(cameras[i].to_world(p))))
        .collect();
    let colours: Vec<[u8; 3]> = (0..count).flat_map(|i| [camera_colour(i, count); 16]).collect();
    scene.add("frusta", LINES, &lines, &colours, &[]);

    let mut videos: Vec<u32> = points.views.iter().map(|v| v.time.video).collect();
    videos.sort_unstable();
    videos.dedup();
    for video in videos {
        let images: Vec<usize> = (0..count).filter(|&i| points.views[i].time.video == video).collect();
        let (translations, rotations) = poses(cameras, &images, &to_scene);
        let name = format!("camera of video {video}");
        let (lens, mesh_size) = (images[0], size(images[0]));
        let k = points.views[lens].intrinsics;
        let [across, down] = [f64::from(mesh_size.0) / f64::from(k[0][0]), f64::from(mesh_size.1) / f64::from(k[1][1])];
        let outline = frustum(cameras[lens], mesh_size, 1.5 * distance).map(|p| p * TO_GLTF);
        let white = [[255; 3]; 16];
        let mut node = json!({ "name": name, "translation": translations[..3], "rotation": rotations[..4] });
        if let Some(mesh) = scene.mesh(&name, LINES, &outline, &white, &[]) {
            node["mesh"] = json!(mesh);
        }
        if across > 0.0 && down > 0.0 {
            let camera = json!({ "type": "perspective", "name": name, "perspective": {
                "yfov": 2.0 * (0.5 * down).atan(), "aspectRatio": across / down, "znear": 0.1 * distance,
            } });
            node["camera"] = json!(scene.camera(camera));
        }
        let node = scene.node(node);
        if images.len() > 1 {
            let input = scene.keys(&seconds(&images));
            scene.animate(node, "translation", input, "VEC3", &translations);
            scene.animate(node, "rotation", input, "VEC4", &rotations);
        }
    }
}

/// Positions (x, y, z) and orientations (x, y, z, w) of camera nodes in the scene, neighbours on one side of the double cover.
fn poses(cameras: &[Camera], images: &[usize], to_scene: impl Fn(DVec3) -> DVec3) -> (Vec<f32>, Vec<f32>) {
    let (mut translations, mut rotations) = (Vec::new(), Vec::new());
    let mut last = DQuat::IDENTITY;
    for &i in images {
        let centre = to_scene(cameras[i].to_world(DVec3::ZERO));
        let direction = |axis: DVec3| to_scene(cameras[i].to_world(axis * TO_GLTF)) - centre;
        let axes = DMat3::from_cols(direction(DVec3::X), direction(DVec3::Y), direction(DVec3::Z));
        let turn = DQuat::from_mat3(&axes).normalize();
        last = if turn.dot(last) < 0.0 { -turn } else { turn };
        translations.extend(centre.as_vec3().to_array());
        rotations.extend(last.as_quat().normalize().to_array());
    }
    (translations, rotations)
}

#[cfg(test)]
mod tests {
    use super::key_times;

    #[test]
    fn keys_have_both_ends() {
        assert_eq!(key_times(1, 32), [0]);
        assert_eq!(key_times(3, 32), [0, 1, 2]);
        let keys = key_times(100, 32);
        assert_eq!((keys.len(), keys[0], keys[31]), (32, 0, 99));
        assert!(keys.windows(2).all(|w| w[0] < w[1]));
    }
}
