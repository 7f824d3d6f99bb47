//! Made scenes for trying things out: boxes and spheres that move in a room, with exact ground truth, as a function of (seed, index).
//!
//! ```text
//! world    metres, x right, y down, z forward; the room is a box, seen from inside
//! things   2 to 5 boxes and spheres, each rigid: p(τ) = R(τ) q + c(τ), a constant speed and a constant turn; τ from 0 to 1
//! camera   near the origin, looks along z, drifts and turns a little
//! ```
//!
//! Every pixel is a ray through its centre, in f64, from the camera as the sample states it in f32. What the ray meets first gives colour
//! (a pattern in the thing's own coordinates, so that it moves along), depth, and, as the thing carries the point on, its place at every
//! time. A point is visible in another image if the ray to it meets nothing before. It is small on purpose: data to learn from is
//! made elsewhere.

use glam::{DMat3, DQuat, DVec3};
use omnix_data::{Dense, Flag, Motion, Sample, SampleParts, Time, Unit};
use omnix_geometry::{Camera, IDENTITY_POSE, Pose};

use crate::TrainError;
use crate::random::Random;
use crate::source::Source;

/// Entries of the dense paths of a sample at most: 3 GiB of positions.
const MOST: u64 = 1 << 28;
/// The room.
const LOW: DVec3 = DVec3::new(-6.0, -3.0, -3.0);
const HIGH: DVec3 = DVec3::new(6.0, 1.5, 12.0);
/// Towards the lamp.
const LAMP: DVec3 = DVec3::new(0.4, -0.8, -0.45);

/// Scenes of one number of images and one size.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shapes {
    images: u32,
    size: [u32; 2],
}

#[derive(Debug, Clone, Copy)]
enum Form {
    Sphere(f64),
    Box(DVec3),
}

#[derive(Debug, Clone, Copy)]
struct Thing {
    form: Form,
    centre: DVec3,
    speed: DVec3,
    axis: DVec3,
    angle: f64,
    turn: f64,
    moves: bool,
    paint: Paint,
}

/// A pattern of two colours.
#[derive(Debug, Clone, Copy)]
struct Paint {
    colours: [DVec3; 2],
    per_metre: f64,
    stripes: bool,
}

/// What a ray meets.
#[derive(Debug, Clone, Copy)]
struct Hit {
    /// In units of the ray's direction.
    distance: f64,
    /// Index of the thing; none for the room.
    thing: Option<usize>,
    /// The point in the thing's own coordinates, or the world's.
    local: DVec3,
    /// In the world, towards the ray's origin.
    normal: DVec3,
}

struct Scene {
    things: Vec<Thing>,
    room: Paint,
}

impl Shapes {
    /// Scenes of this number of images of this width and height.
    ///
    /// # Errors
    /// No image, no pixel, or more entries of paths than can be held.
    pub fn new(images: u32, size: [u32; 2]) -> Result<Self, TrainError> {
        let entries = [images, images, size[0], size[1]].into_iter().map(u64::from).try_fold(1u64, u64::checked_mul);
        match entries {
            Some(1..=MOST) => Ok(Self { images, size }),
            _ => Err(TrainError::SampleSize { images, size }),
        }
    }

    /// The sample of an index.
    ///
    /// # Errors
    /// None that a valid size can cause; those of [`Sample::new`].
    pub fn sample(&self, seed: u64, index: u64) -> Result<Sample, TrainError> {
        let mut random = Random::new(seed, "shapes", index);
        let scene = Scene::new(&mut random);
        let cameras = self.cameras(&mut random);
        let (count, pixels) = (self.images as usize, self.size[0] as usize * self.size[1] as usize);
        let mut parts = SampleParts {
            size: self.size,
            images: Vec::with_capacity(count * pixels * 3),
            times: (0..self.images).map(|t| self.time(t)).collect(),
            cameras: cameras.clone(),
            depth: None,
            moving: None,
            motion: Motion::Unknown,
            unit: Unit::Metre,
        };
        let eyes: Vec<Eye> = cameras.iter().map(Eye::new).collect();
        let (mut depth, mut moving) = (Vec::with_capacity(count * pixels), Vec::with_capacity(count * pixels));
        let (mut positions, mut visible) = (Vec::new(), Vec::new());
        for (source, eye) in eyes.iter().enumerate() {
            let tau = self.tau(source);
            let hits: Vec<Hit> = self.pixels().map(|pixel| scene.cast(eye.centre, eye.ray(pixel), tau)).collect();
            for hit in &hits {
                parts.images.extend(scene.colour(hit));
                // The ray's direction has z = 1 in the camera's frame.
                depth.push(hit.distance as f32);
                moving.push(Flag::from(hit.thing.is_some_and(|thing| scene.things[thing].moves)));
            }
            for (time, other) in eyes.iter().enumerate() {
                let tau = self.tau(time);
                for hit in &hits {
                    let point = scene.place(hit, tau);
                    positions.push(point.as_vec3().to_array());
                    visible.push(Flag::from(self.sees(&scene, other, point, tau)));
                }
            }
        }
        (parts.depth, parts.moving) = (Some(depth), Some(moving));
        parts.motion = Motion::Dense(Dense { positions, visible: Some(visible) });
        Ok(Sample::new(parts)?)
    }

    fn time(&self, image: u32) -> Time {
        Time { video: 0, frame: image, moment: image, seconds: Some(self.tau(image as usize)) }
    }

    /// The moment of an image, from 0 to 1.
    fn tau(&self, image: usize) -> f64 {
        image as f64 / f64::from(self.images.max(2) - 1)
    }

    /// Centres of all pixels, row by row.
    fn pixels(&self) -> impl Iterator<Item = [f64; 2]> {
        let [width, height] = self.size;
        (0..height).flat_map(move |i| (0..width).map(move |j| [f64::from(j) + 0.5, f64::from(i) + 0.5]))
    }

    fn cameras(&self, random: &mut Random) -> Vec<Camera> {
        let [width, height] = self.size.map(f64::from);
        let focal = random.between(0.75, 1.2) * width;
        let [start, drift] = [0.4, 0.6].map(|by| vector(random, by) * DVec3::new(1.0, 0.5, 1.0));
        let [look, turn] = [0.12, 0.15].map(|by| vector(random, by));
        (0..self.images as usize)
            .map(|image| {
                let tau = self.tau(image);
                let (centre, angles) = (start + drift * tau, look + turn * tau);
                let c2w = DQuat::from_euler(glam::EulerRot::YXZ, angles.y, angles.x, 0.3 * angles.z);
                let rotation = DMat3::from_quat(c2w.inverse());
                let translation = -(rotation * centre);
                let mut pose: Pose = IDENTITY_POSE;
                for (row, out) in pose.iter_mut().enumerate() {
                    let r = rotation.row(row);
                    *out = [r.x, r.y, r.z, translation[row]].map(|v| v as f32);
                }
                let intrinsics = [
                    [focal as f32, 0.0, (width / 2.0) as f32],
                    [0.0, focal as f32, (height / 2.0) as f32],
                    [0.0, 0.0, 1.0],
                ];
                Camera { extrinsics: pose, intrinsics }
            })
            .collect()
    }

    fn sees(&self, scene: &Scene, eye: &Eye, point: DVec3, tau: f64) -> bool {
        let Some([x, y]) = eye.project(point) else { return false };
        let inside = (0.0..f64::from(self.size[0])).contains(&x) && (0.0..f64::from(self.size[1])).contains(&y);
        inside && scene.cast(eye.centre, point - eye.centre, tau).distance > 1.0 - 1e-6
    }
}

impl Source for Shapes {
    fn label(&self) -> String {
        "made shapes".to_owned()
    }

    fn sample(&self, seed: u64, number: u64) -> Result<Sample, TrainError> {
        Self::sample(self, seed, number)
    }
}

/// A camera for rays.
struct Eye {
    to_camera: DMat3,
    to_world: DMat3,
    centre: DVec3,
    focal: [f64; 2],
    principal: [f64; 2],
}

impl Eye {
    fn new(camera: &Camera) -> Self {
        let rows = camera.extrinsics.map(|row| row.map(f64::from));
        let to_camera = DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| rows[r][c])));
        // The inverse of what was rounded to f32, so that depth and pose fit each other.
        let to_world = to_camera.inverse();
        let k = camera.intrinsics.map(|row| row.map(f64::from));
        let centre = -(to_world * DVec3::new(rows[0][3], rows[1][3], rows[2][3]));
        Self { to_camera, to_world, centre, focal: [k[0][0], k[1][1]], principal: [k[0][2], k[1][2]] }
    }

    /// The direction of a pixel's ray in the world; z in the camera's frame is 1.
    fn ray(&self, pixel: [f64; 2]) -> DVec3 {
        let at = |axis: usize| (pixel[axis] - self.principal[axis]) / self.focal[axis];
        self.to_world * DVec3::new(at(0), at(1), 1.0)
    }

    fn project(&self, point: DVec3) -> Option<[f64; 2]> {
        let p = self.to_camera * (point - self.centre);
        (p.z > 1e-9).then(|| [0, 1].map(|axis| self.focal[axis] * p[axis] / p.z + self.principal[axis]))
    }
}

/// Each coordinate uniform between plus and minus `by`.
fn vector(random: &mut Random, by: f64) -> DVec3 {
    DVec3::new(random.between(-by, by), random.between(-by, by), random.between(-by, by))
}

impl Scene {
    fn new(random: &mut Random) -> Self {
        let count = 2 + random.below(4);
        // The first one always moves.
        let things = (0..count).map(|i| Thing::new(random, i == 0)).collect();
        Self { things, room: Paint::new(random, 0.5, 1.5) }
    }

    fn cast(&self, origin: DVec3, ray: DVec3, tau: f64) -> Hit {
        let mut nearest = room(origin, ray);
        for (index, thing) in self.things.iter().enumerate() {
            let turn = thing.turned(tau);
            let (o, r) = (turn.inverse() * (origin - thing.at(tau)), turn.inverse() * ray);
            let hit = match thing.form {
                Form::Sphere(radius) => sphere(o, r, radius),
                Form::Box(half) => cuboid(o, r, half),
            };
            if let Some((distance, normal)) = hit
                && distance < nearest.distance
            {
                nearest = Hit { distance, thing: Some(index), local: o + r * distance, normal: turn * normal };
            }
        }
        nearest
    }

    /// Where a point is at a time.
    fn place(&self, hit: &Hit, tau: f64) -> DVec3 {
        hit.thing.map_or(hit.local, |thing| {
            let thing = &self.things[thing];
            thing.turned(tau) * hit.local + thing.at(tau)
        })
    }

    fn colour(&self, hit: &Hit) -> [u8; 3] {
        let paint = hit.thing.map_or(self.room, |thing| self.things[thing].paint);
        let light = 0.35 + 0.65 * hit.normal.dot(LAMP.normalize()).max(0.0);
        (paint.colour(hit.local) * light * 255.0).to_array().map(|v| v.round().clamp(0.0, 255.0) as u8)
    }
}

impl Thing {
    fn new(random: &mut Random, must_move: bool) -> Self {
        let size = random.between(0.35, 0.9);
        let form = if random.uniform() < 0.5 {
            Form::Sphere(size)
        } else {
            Form::Box(DVec3::new(size, size * random.between(0.5, 1.3), size * random.between(0.5, 1.3)))
        };
        let centre = DVec3::new(random.between(-2.2, 2.2), random.between(-1.0, 0.8), random.between(3.0, 7.5));
        let (axis, moves) = (vector(random, 1.0), must_move || random.uniform() < 0.6);
        let (speed, turn) = (vector(random, 1.5), random.between(-1.5, 1.5));
        Self {
            form,
            centre,
            speed: if moves { speed } else { DVec3::ZERO },
            axis: axis.try_normalize().unwrap_or(DVec3::Y),
            angle: random.between(0.0, std::f64::consts::TAU),
            turn: if moves { turn } else { 0.0 },
            moves,
            paint: Paint::new(random, 1.5, 5.0),
        }
    }

    fn at(&self, tau: f64) -> DVec3 {
        self.centre + self.speed * tau
    }

    fn turned(&self, tau: f64) -> DQuat {
        DQuat::from_axis_angle(self.axis, self.angle + self.turn * tau)
    }
}

impl Paint {
    fn new(random: &mut Random, low: f64, high: f64) -> Self {
        let mut colour = || DVec3::new(random.between(0.1, 1.0), random.between(0.1, 1.0), random.between(0.1, 1.0));
        let colours = [colour(), colour()];
        Self { colours, per_metre: random.between(low, high), stripes: random.uniform() < 0.4 }
    }

    fn colour(&self, local: DVec3) -> DVec3 {
        // A little off the axes, so that no face of a box lies on the edge of a square.
        let cell = (local * self.per_metre + 0.013).floor();
        let which = if self.stripes { cell.x + cell.y } else { cell.x + cell.y + cell.z };
        self.colours[usize::from(which.rem_euclid(2.0) >= 1.0)]
    }
}

fn sphere(o: DVec3, r: DVec3, radius: f64) -> Option<(f64, DVec3)> {
    let (a, b, c) = (r.length_squared(), o.dot(r), o.length_squared() - radius * radius);
    let root = (b * b - a * c).max(-1.0);
    let distance = (-b - root.max(0.0).sqrt()) / a;
    (root > 0.0 && distance > 0.0).then(|| (distance, (o + r * distance) / radius))
}

fn cuboid(o: DVec3, r: DVec3, half: DVec3) -> Option<(f64, DVec3)> {
    let (a, b) = ((-half - o) / r, (half - o) / r);
    let (enter, leave) = (a.min(b), a.max(b));
    let distance = enter.max_element();
    if !(distance > 0.0 && distance < leave.min_element()) {
        return None;
    }
    let axis = (0..3).find(|axis| enter[*axis] == distance)?;
    Some((distance, -DVec3::AXES[axis] * r[axis].signum()))
}

/// Where a ray from inside leaves the room.
fn room(o: DVec3, r: DVec3) -> Hit {
    let leave = ((LOW - o) / r).max((HIGH - o) / r);
    let axis = (0..3).min_by(|a, b| leave[*a].total_cmp(&leave[*b])).unwrap_or(0);
    let distance = leave[axis];
    Hit { distance, thing: None, local: o + r * distance, normal: -DVec3::AXES[axis] * r[axis].signum() }
}

#[cfg(test)]
mod tests {
    use omnix_data::{normalise, targets};

    use super::*;

    fn shapes() -> Shapes {
        Shapes::new(3, [42, 28]).unwrap()
    }

    #[test]
    fn a_function_of_seed_and_index() {
        assert_eq!(shapes().sample(1, 5).unwrap(), shapes().sample(1, 5).unwrap());
        assert_ne!(shapes().sample(1, 5).unwrap(), shapes().sample(1, 6).unwrap());
        assert_ne!(shapes().sample(1, 5).unwrap(), shapes().sample(2, 5).unwrap());
    }

    /// Depth and paths say the same of a pixel's own point, and what is visible elsewhere has the depth that is seen there.
    #[test]
    fn labels_agree() {
        let (mut moving, mut seen) = (0, 0);
        for index in 0..6 {
            let sample = shapes().sample(9, index).unwrap();
            for source in 0..3 {
                let (eye, own) = (Eye::new(&sample.cameras()[source]), sample.positions(source, source).unwrap());
                for (k, pixel) in shapes().pixels().enumerate() {
                    let point = DVec3::from(own[k].map(f64::from));
                    let [x, y] = eye.project(point).unwrap();
                    assert!((x - pixel[0]).abs() < 1e-3 && (y - pixel[1]).abs() < 1e-3);
                    let z = (eye.to_camera * (point - eye.centre)).z;
                    assert!((z / f64::from(sample.depth(source).unwrap()[k]) - 1.0).abs() < 1e-5);
                    assert_eq!(sample.visible(source, source).unwrap()[k], Flag::Yes);
                    let still = sample.positions(source, 2 - source).unwrap()[k] == own[k];
                    let is_moving = sample.moving(source).unwrap()[k] == Flag::Yes;
                    assert!(source == 1 || still != is_moving);
                    moving += usize::from(is_moving);
                }
                for time in (0..3).filter(|time| *time != source) {
                    let other = Eye::new(&sample.cameras()[time]);
                    let visible = sample.visible(source, time).unwrap();
                    for (point, _) in
                        sample.positions(source, time).unwrap().iter().zip(visible).filter(|p| *p.1 == Flag::Yes)
                    {
                        let point = DVec3::from(point.map(f64::from));
                        let [x, y] = other.project(point).unwrap();
                        let z = (other.to_camera * (point - other.centre)).z;
                        let shown = sample.depth(time).unwrap()[y as usize * 42 + x as usize];
                        // Within the pixel the surface may be nearer or farther, but rarely by much.
                        seen += usize::from((z / f64::from(shown) - 1.0).abs() < 0.1);
                    }
                }
            }
        }
        assert!(moving > 500 && seen > 10_000, "{moving} {seen}");
    }

    #[test]
    fn training_takes_them() {
        let made = normalise(shapes().sample(3, 0).unwrap()).unwrap();
        assert!(made.distance.is_some_and(|mean| mean > 1.0));
        assert_eq!(made.sample.unit(), Unit::MeanDistance);
        assert_eq!(targets::rays(&made.sample).unwrap().len(), 3 * 16 * 24 * 6);
    }

    #[test]
    fn sizes_that_no_memory_holds_are_refused() {
        for (images, size) in [(0, [14, 14]), (2, [0, 14]), (u32::MAX, [u32::MAX; 2]), (1000, [1000, 1000])] {
            assert!(matches!(Shapes::new(images, size), Err(TrainError::SampleSize { .. })));
        }
    }
}
