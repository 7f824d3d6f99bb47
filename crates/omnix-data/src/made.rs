//! For the tests: a scene whose truth is known in closed form, and writers of the files that data sets consist of.
//!
//! The scene is a slanted wall, z = 6 + 0.3 x + 0.2 y, in front of which a flat plate moves and turns: half sides 1.2 and 0.8, centre
//! (0.5 m - 0.7, 0.2, 3.4) at moment m, turned by 0.2 m about its vertical axis. World and cameras have OpenCV axes.

use std::io::{BufWriter, Write as _};
use std::path::Path;

use glam::{DMat3, DVec3};
use npyz::WriterBuilder as _;
use omnix_geometry::Camera;

use crate::rigid::{Pinhole, Rigid, centre};
use crate::{Dense, Flag, Motion, Sample, SampleParts, Time, Unit};

/// The plate's pose at a moment.
fn plate(moment: u32) -> Rigid {
    let m = f64::from(moment);
    Rigid { rotation: DMat3::from_rotation_y(0.2 * m), translation: DVec3::new(0.5 * m - 0.7, 0.2, 3.4) }
}

const HALF: [f64; 2] = [1.2, 0.8];

/// The corners of the plate at a moment, in the world, and its two faces.
pub(crate) fn mesh(moment: u32) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let pose = plate(moment);
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
    let corners = corners.map(|[x, y]| pose.apply(DVec3::new(x * HALF[0], y * HALF[1], 0.0)).to_array());
    (corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// What a ray from `origin` meets at a moment: how far along `direction`, and the point on the plate in the plate's frame.
fn hit(origin: DVec3, direction: DVec3, moment: u32) -> (f64, Option<DVec3>) {
    let wall = DVec3::new(-0.3, -0.2, 1.0);
    let far = (6.0 - wall.dot(origin)) / wall.dot(direction);
    let to_plate = plate(moment).inverse();
    let (from, along) = (to_plate.apply(origin), to_plate.rotation * direction);
    let near = -from.z / along.z;
    let point = from + along * near;
    let inside = point.x.abs() <= HALF[0] && point.y.abs() <= HALF[1];
    if inside && near > 0.0 && near < far { (near, Some(point)) } else { (far, None) }
}

/// A camera of a picture of this size: its field of view is 60 degrees across, its principal point a little off the centre.
pub(crate) fn camera([width, height]: [u32; 2], position: [f64; 3], turn: [f64; 2]) -> Pinhole {
    let focal = f64::from(width) / 2.0 / 30f64.to_radians().tan();
    let rotation = DMat3::from_rotation_y(turn[0]) * DMat3::from_rotation_x(turn[1]);
    Pinhole {
        w2c: Rigid { rotation, translation: DVec3::from(position) }.inverse(),
        focal: [focal, focal * 1.02],
        principal: [f64::from(width) / 2.0 + 1.0, f64::from(height) / 2.0 - 0.5],
        skew: 0.0,
    }
}

/// A moving camera: moment m of video v.
pub(crate) fn path(size: [u32; 2], video: u32, moment: u32) -> Pinhole {
    let (v, m) = (f64::from(video), f64::from(moment));
    let position = [0.35 * m + 0.8 * v - 0.5, -0.25 * m + 0.3 * v, 0.22 * m - 0.1 * v];
    camera(size, position, [-0.07 * m - 0.1 * v, 0.05 * m - 0.06 * v])
}

/// The sample of these cameras with all its truth.
pub(crate) fn sample(size: [u32; 2], views: &[(Time, Pinhole)]) -> Sample {
    let (count, width) = (views.len(), size[0] as usize);
    let pixels = width * size[1] as usize;
    // As a sample holds them, so that rounding is no error of the truth.
    let cameras: Vec<Camera> = views.iter().map(|(_, camera)| camera.to_camera()).collect();
    let seen_by: Vec<Pinhole> = cameras.iter().map(Pinhole::new).collect();
    let mut parts = SampleParts {
        size,
        images: Vec::new(),
        times: views.iter().map(|(time, _)| *time).collect(),
        cameras,
        depth: Some(Vec::new()),
        moving: Some(Vec::new()),
        motion: Motion::Unknown,
        unit: Unit::Metre,
    };
    let mut dense = Dense {
        positions: vec![[0.0; 3]; count * count * pixels],
        visible: Some(vec![Flag::No; count * count * pixels]),
    };
    for (source, camera) in seen_by.iter().enumerate() {
        let c2w = camera.w2c.inverse();
        for pixel in 0..pixels {
            let [u, v] = centre(pixel, width);
            let (depth, on_plate) =
                hit(c2w.translation, c2w.rotation * camera.unproject(u, v, 1.0), parts.times[source].moment);
            let world = c2w.apply(camera.unproject(u, v, depth));
            let shade = |k: f64| ((k * 37.0).sin() * 0.5 + 0.5) * 200.0 + 30.0;
            let [x, y] = on_plate.map_or([world.x, world.y], |p| [p.x * 2.0 + 9.0, p.y * 2.0]);
            let colour = [shade(x * 0.1), shade(y * 0.1), if on_plate.is_some() { 220.0 } else { 60.0 }];
            parts.images.extend(colour.map(|c| c as u8));
            parts.depth.as_mut().unwrap().push(depth as f32);
            parts.moving.as_mut().unwrap().push(on_plate.is_some().into());
            for (time, other) in seen_by.iter().enumerate() {
                let moment = parts.times[time].moment;
                let at = on_plate.map_or(world, |p| plate(moment).apply(p));
                let index = (source * count + time) * pixels + pixel;
                dense.positions[index] = at.as_vec3().to_array();
                dense.visible.as_mut().unwrap()[index] = shows(other, size, at, moment).into();
            }
        }
    }
    parts.motion = Motion::Dense(dense);
    Sample::new(parts).unwrap()
}

/// Whether a camera sees this point of the scene.
fn shows(camera: &Pinhole, [width, height]: [u32; 2], point: DVec3, moment: u32) -> bool {
    let seen = camera.w2c.apply(point);
    let [u, v] = camera.project(seen);
    let inside = u >= 0.0 && v >= 0.0 && u < f64::from(width) && v < f64::from(height);
    let c2w = camera.w2c.inverse();
    seen.z > 0.0 && inside && hit(c2w.translation, point - c2w.translation, moment).0 > 1.0 - 1e-6
}

/// One video of a moving camera.
pub(crate) fn video(size: [u32; 2], frames: u32) -> Sample {
    let views: Vec<_> = (0..frames).map(|f| (time(0, f), path(size, 0, f))).collect();
    sample(size, &views)
}

pub(crate) fn time(video: u32, frame: u32) -> Time {
    Time { video, frame, moment: frame, seconds: None }
}

/// The camera-to-world pose of an image, 4 x 4, and its intrinsics.
pub(crate) fn pose_and_intrinsics(sample: &Sample, image: usize) -> ([f64; 16], [f64; 9]) {
    let camera = Pinhole::new(&sample.cameras()[image]);
    let c2w = camera.w2c.inverse();
    let rows = c2w.rotation.transpose().to_cols_array_2d();
    let t = c2w.translation.to_array();
    let mut pose = [0.0; 16];
    for i in 0..3 {
        pose[4 * i..4 * i + 3].copy_from_slice(&rows[i]);
        pose[4 * i + 3] = t[i];
    }
    pose[15] = 1.0;
    let k = sample.cameras()[image].intrinsics;
    (pose, std::array::from_fn(|i| f64::from(k[i / 3][i % 3])))
}

fn folder_of(path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
}

/// Writes named arrays of f64.
pub(crate) fn npz(path: &Path, arrays: &[(&str, &[u64], &[f64])]) {
    folder_of(path);
    let mut archive = npyz::npz::NpzWriter::create(path).unwrap();
    for (name, shape, values) in arrays {
        let options = Default::default();
        let mut writer = archive.array(name, options).unwrap().default_dtype().shape(shape).begin_nd().unwrap();
        writer.extend(values.iter().copied()).unwrap();
        writer.finish().unwrap();
    }
}

/// Writes an array of f32.
pub(crate) fn npy(path: &Path, shape: &[u64], values: &[f32]) {
    folder_of(path);
    let file = BufWriter::new(std::fs::File::create(path).unwrap());
    let mut writer = npyz::WriteOptions::new().default_dtype().shape(shape).writer(file).begin_nd().unwrap();
    writer.extend(values.iter().copied()).unwrap();
    writer.finish().unwrap();
}

/// Writes a map of one channel.
pub(crate) fn exr(path: &Path, [width, height]: [usize; 2], values: &[f32]) {
    use exr::prelude::{AnyChannel, AnyChannels, FlatSamples, Image, WritableImage as _};
    folder_of(path);
    let channel = AnyChannel::new("Y", FlatSamples::F32(values.to_vec()));
    let channels = AnyChannels::sort([channel].into_iter().collect());
    Image::from_channels((width, height), channels).write().to_file(path).unwrap();
}

/// Writes a picture of three channels.
pub(crate) fn exr_rgb(path: &Path, [width, height]: [usize; 2]) {
    exr::prelude::write_rgb_file(path, width, height, |_, _| (0.5f32, 0.5f32, 0.5f32)).unwrap();
}

/// Writes one image of a sample as a picture of the type that the name says.
pub(crate) fn picture(path: &Path, sample: &Sample, image: usize) {
    folder_of(path);
    let [width, height] = sample.size();
    image::RgbImage::from_raw(width, height, sample.image(image).to_vec()).unwrap().save(path).unwrap();
}

/// Writes a mask: 255 where it holds.
pub(crate) fn mask(path: &Path, [width, height]: [u32; 2], holds: impl IntoIterator<Item = bool>) {
    folder_of(path);
    let values = holds.into_iter().map(|yes| if yes { 255 } else { 0 }).collect();
    image::GrayImage::from_raw(width, height, values).unwrap().save(path).unwrap();
}

/// Writes a map of 16 bits.
pub(crate) fn deep(path: &Path, [width, height]: [u32; 2], values: Vec<u16>) {
    folder_of(path);
    let map = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(width, height, values).unwrap();
    map.save(path).unwrap();
}

/// Writes a text.
pub(crate) fn text(path: &Path, text: &str) {
    folder_of(path);
    std::fs::File::create(path).unwrap().write_all(text.as_bytes()).unwrap();
}
