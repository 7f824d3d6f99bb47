//! Cameras of a scene: where they are over time, where they look, with which lens.
//!
//! A rig is refused where it comes too near to something, is inside of something, or sees little but one near thing or the sky.

use glam::{DVec2, DVec3};

use crate::cast::{Geometry, Ray};
use crate::clean::Refusal;
use crate::motion::spline;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::stage::Spot;
use crate::view::View;

/// Rays across and down that judge a camera.
const PROBES: [usize; 2] = [9, 6];

/// One camera over the scene's time.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    /// Splines over the scene's time.
    places: Vec<DVec3>,
    targets: Vec<DVec3>,
    roll: f64,
    /// Shakes of a hand: metres and radians.
    shake: f64,
    phase: f64,
    /// Focal length in widths of the picture, at the beginning and at the end.
    focal: [f64; 2],
    /// Principal point's distance from the middle, in widths of the picture.
    principal: DVec2,
    seconds: f64,
    /// Distance to what it looks at, for what counts as near.
    reach: f64,
}

impl Rig {
    /// A camera about a spot; `turn` is the side that it looks from.
    pub(crate) fn draw(random: &mut Random, recipe: &Recipe, spot: &Spot, turn: f64, seconds: f64) -> Self {
        let clamp = |p: DVec3| p.clamp(spot.inside[0], spot.inside[1]);
        let aim = DVec3::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(-1.0, 1.0)) * spot.spread;
        let target = spot.focus + aim;
        let away = random.within(spot.distance);
        let height = random.within(spot.height);
        let around = |turn: f64, away: f64, height: f64| {
            clamp(spot.focus.with_z(0.0) + (DVec2::from_angle(turn) * away).extend(height))
        };
        let place = around(turn, away, height);
        let reach = place.distance(target);
        // Way and turn while the scene lasts.
        let way = reach * random.log_range(0.04, 0.5) * random.sign();
        let (mut places, mut targets, mut shake, mut focal_change) = (vec![place], vec![target], 0.0, 1.0);
        match random.weighted(&recipe.cameras.weights()) {
            0 => {}
            1 => {
                let angle = way / away.max(0.2);
                places = (0..6).map(|k| around(turn + angle * f64::from(k) / 5.0, away, height)).collect();
            }
            2 => {
                let ahead = (target - place).normalize_or(DVec3::X);
                let side = ahead.cross(DVec3::Z).normalize_or(DVec3::Y);
                let direction = if random.chance(0.5) { ahead } else { side };
                let step = if direction == ahead { way.abs().min(reach * 0.3) * way.signum() } else { way };
                places.push(clamp(place + direction * step));
                targets.push(if random.chance(0.5) { target } else { target + direction * step });
            }
            3 => {
                for k in 1..4 {
                    let drift = random.direction() * way.abs() * 0.4;
                    let more = around(turn + way / away.max(0.2) * f64::from(k) / 3.0, away, height)
                        + drift * f64::from(k) / 3.0;
                    places.push(clamp(more));
                }
                targets.push(target + random.direction() * 0.15 * reach);
            }
            4 => {
                shake = random.log_range(0.004, 0.03);
                places.push(clamp(place + random.direction() * way.abs() * 0.4));
            }
            5 => {
                let side = (target - place).cross(DVec3::Z).normalize_or(DVec3::Y);
                targets.push(target + side * way + DVec3::Z * random.range(-0.1, 0.1) * reach);
            }
            _ => focal_change = random.range(0.7, 1.4),
        }
        let [low, high] = recipe.field_of_view.map(|degrees| 0.5 / (degrees.to_radians() / 2.0).tan());
        let focal = random.log_range(high, low);
        let off = DVec2::new(random.range(-1.0, 1.0), random.range(-1.0, 1.0)) * recipe.principal;
        Self {
            places,
            targets,
            roll: if random.chance(0.3) { random.normal() * 0.12 } else { random.normal() * 0.02 },
            shake,
            phase: random.range(0.0, 100.0),
            focal: [focal, focal * focal_change],
            principal: if random.chance(0.5) { DVec2::ZERO } else { off },
            seconds,
            reach,
        }
    }

    /// The camera at a time.
    pub(crate) fn at(&self, t: f64, size: [usize; 2]) -> View {
        let s = (t / self.seconds.max(1e-9)).clamp(0.0, 1.0);
        let wave = |k: f64| {
            (t * (3.1 + k) + self.phase * (1.0 + 0.3 * k)).sin() + 0.5 * (t * (7.7 + 1.7 * k) + self.phase * k).sin()
        };
        let shake = DVec3::new(wave(0.0), wave(1.0), wave(2.0)) * self.shake;
        let from = spline(&self.places, s) + shake * self.reach * 0.3;
        let to = spline(&self.targets, s) + DVec3::new(wave(3.0), wave(4.0), wave(5.0)) * self.shake * self.reach * 0.6;
        let [width, height] = size.map(|v| v as f64);
        let focal = self.focal[0] * (self.focal[1] / self.focal[0]).powf(s) * width;
        let middle = DVec2::new(width, height) / 2.0;
        View::looking(from, to, self.roll + wave(6.0) * self.shake * 0.5, focal, middle + self.principal * width, size)
    }

    /// Puts the camera above uneven ground: its places' heights are then above what lies below them.
    pub(crate) fn above(&mut self, geometry: &Geometry) {
        for place in &mut self.places {
            let ray = Ray { origin: place.with_z(300.0), direction: DVec3::NEG_Z };
            if let Some(hit) = geometry.cast(&ray, 0.0, 1e3) {
                place.z += 300.0 - hit.t;
            }
        }
    }

    /// Why a camera is refused, at one time.
    pub(crate) fn judge(&self, geometry: &Geometry, t: f64, size: [usize; 2]) -> Result<(), Refusal> {
        let view = self.at(t, size);
        let near = (self.reach * 0.12).clamp(0.06, 0.4);
        let mut inside = 0;
        const SIDES: usize = 26;
        for k in 0..SIDES {
            let (x, y, z) = ((k + 1) % 3, (k + 1) / 3 % 3, (k + 1) / 9 % 3);
            let direction = DVec3::new(x as f64 - 1.0, y as f64 - 1.0, z as f64 - 1.0).normalize_or(DVec3::X);
            if let Some(hit) = geometry.cast(&Ray { origin: view.centre, direction }, 0.0, 1e4) {
                if hit.t < near {
                    return Err(Refusal::Near);
                }
                inside += usize::from(geometry.face_normal(&hit).dot(direction) > 0.0);
            }
        }
        // Leaves and cloths are seen from behind as well.
        if inside > SIDES / 3 {
            return Err(Refusal::Inside);
        }
        let [across, down] = PROBES;
        let mut depths = Vec::with_capacity(across * down);
        let mut things = Vec::with_capacity(across * down);
        for k in 0..across * down {
            let part = DVec2::new((k % across) as f64 + 0.5, (k / across) as f64 + 0.5);
            let at = part / DVec2::new(across as f64, down as f64) * DVec2::new(size[0] as f64, size[1] as f64);
            if let Some(hit) = geometry.cast(&view.ray(at), 0.0, 1e4) {
                depths.push(hit.t);
                let (solid, _) = geometry.instance(hit.instance);
                things.push((hit.instance, solid.mesh.slots[hit.triangle as usize]));
            }
        }
        things.sort_unstable();
        things.dedup();
        if things.len() < 4 {
            return Err(Refusal::Bare);
        }
        if depths.len() * 2 < across * down {
            return Err(Refusal::Sky);
        }
        depths.sort_by(f64::total_cmp);
        let blocked = depths.iter().filter(|&&depth| depth < self.reach * 0.3).count();
        if blocked * 4 > depths.len() {
            return Err(Refusal::Blocked);
        }
        if depths[depths.len() / 20] * 1.15 > depths[depths.len() * 19 / 20] {
            return Err(Refusal::Flat);
        }
        Ok(())
    }
}
