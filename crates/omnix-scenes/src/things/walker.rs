//! People and animals that walk: capsules on joints that swing in step.
//!
//! x is ahead. The gait's rate follows from speed and leg length: a leg swings from one side of the vertical to the other while the
//! body moves by the length of a step.

use std::sync::Arc;

use glam::{DVec2, DVec3};

use crate::actor::{Actor, Part};
use crate::cast::Solid;
use crate::mesh::Mesh;
use crate::motion::{Angle, Joint, Motion};
use crate::palette;
use crate::random::Random;
use crate::shapes::{capsule, rounded, sphere, superquadric};
use crate::things::Kit;

/// Joints and parts while a figure is put together.
#[derive(Default)]
struct Figure {
    joints: Vec<Joint>,
    parts: Vec<Part>,
}

impl Figure {
    fn joint(&mut self, parent: Option<usize>, place: DVec3, axis: DVec3, angle: Angle) -> usize {
        self.joints.push(Joint { parent, place, axis, angle, slides: false });
        self.joints.len() - 1
    }

    fn part(&mut self, joint: usize, mesh: Mesh) {
        self.parts.push(Part { solid: Arc::new(Solid::new(mesh)), joint: Some(joint), change: None });
    }
}

fn swing(mean: f64, by: f64, rate: f64, phase: f64) -> Angle {
    Angle::Sine { mean, by, rate, phase }
}

/// A person of this height, walking at this speed in metres a second; standing and moving the arms at 0.
pub(crate) fn walker(kit: &mut Kit, random: &mut Random, height: f64, speed: f64, motion: Motion) -> Actor {
    let h = height;
    let (leg, arm) = (0.47 * h, 0.2 * h);
    let stride = (0.25 + 0.2 * speed / h).min(0.55);
    let rate = if speed > 0.05 { std::f64::consts::PI * speed / (2.0 * leg * stride) } else { random.range(1.0, 4.0) };
    let swing_leg = if speed > 0.05 { stride } else { 0.02 };
    let swing_arm = if speed > 0.05 { stride * random.range(0.5, 1.1) } else { random.range(0.1, 1.2) };
    let photos = kit.photos.clone();
    let (shirt, trousers) = (kit.slot(palette::cloth(random, &photos)), kit.slot(palette::cloth(random, &photos)));
    let (skin, hair) = (kit.slot(palette::skin(random)), kit.slot(palette::paint(random)));
    let shoes = kit.slot(palette::paint(random));
    let sleeves = if random.chance(0.5) { shirt } else { skin };
    let legs = if random.chance(0.8) { trousers } else { skin };
    let wide = random.range(0.85, 1.25);
    let mut figure = Figure::default();
    let (y, z) = (DVec3::Y, DVec3::Z);
    let hips = figure.joint(None, DVec3::new(0.0, 0.0, leg + 0.03 * h), z, swing(0.0, 0.08, rate, 0.0));
    let torso =
        rounded(DVec3::new(0.13 * h * wide, 0.23 * h * wide, 0.32 * h), 0.06 * h).moved(z * 0.16 * h).with(shirt);
    let seat = rounded(DVec3::new(0.12 * h * wide, 0.2 * h * wide, 0.12 * h), 0.05 * h).with(trousers);
    figure.part(hips, seat);
    let chest = figure.joint(Some(hips), z * 0.02 * h, z, swing(0.0, 0.12, rate, std::f64::consts::PI));
    figure.part(chest, torso);
    let neck = figure.joint(Some(chest), z * 0.33 * h, z, swing(random.range(-0.5, 0.5), 0.1, rate * 0.37, 1.0));
    let skull = DVec3::new(0.065, 0.052, 0.075) * h;
    let mut head = capsule(-z * 0.03 * h, z * 0.04 * h, 0.03 * h, 0.03 * h, 8).with(skin);
    head.add(&superquadric(skull, [0.9, 0.95], 16, 10).moved(DVec3::new(0.01, 0.0, 0.1) * h).with(skin));
    let cap = superquadric(skull * 1.06, [0.9, 0.95], 16, 10).moved(DVec3::new(-0.006, 0.0, 0.115) * h);
    head.add(&cap.with(hair));
    head.add(&sphere(0.012 * h, 8, 5).moved(DVec3::new(0.077, 0.0, 0.095) * h).with(skin));
    figure.part(neck, head);
    for side in [-1.0, 1.0] {
        let phase = if side > 0.0 { 0.0 } else { std::f64::consts::PI };
        let hip = figure.joint(
            Some(hips),
            DVec3::new(0.0, side * 0.06 * h, -0.02 * h),
            y,
            swing(0.0, swing_leg, rate, phase),
        );
        let (thigh, shin) = (0.24 * h, 0.23 * h);
        figure.part(hip, capsule(DVec3::ZERO, -z * thigh, 0.055 * h * wide, 0.04 * h, 10).with(legs));
        // A knee only bends backwards.
        let bend = if speed > 0.05 { 0.45 } else { 0.03 };
        let knee = figure.joint(Some(hip), -z * thigh, y, swing(bend, bend, rate, phase - 1.6));
        figure.part(knee, capsule(DVec3::ZERO, -z * (shin - 0.02 * h), 0.04 * h, 0.028 * h, 10).with(legs));
        let foot =
            rounded(DVec3::new(0.15, 0.06, 0.045) * h, 0.02 * h).moved(DVec3::new(0.035 * h, 0.0, -shin)).with(shoes);
        figure.part(knee, foot);
        let shoulder = DVec3::new(0.0, side * 0.135 * h * wide, 0.29 * h);
        let raised = if random.chance(0.15) { random.range(-2.5, -0.5) } else { 0.0 };
        let upper =
            figure.joint(Some(chest), shoulder, y, swing(raised, swing_arm, rate, phase + std::f64::consts::PI));
        figure.part(
            upper,
            capsule(DVec3::ZERO, DVec3::new(0.0, side * 0.02 * h, -arm), 0.033 * h, 0.027 * h, 8).with(shirt),
        );
        let elbow_at = DVec3::new(0.0, side * 0.02 * h, -arm);
        let elbow = figure.joint(Some(upper), elbow_at, y, swing(-random.range(0.2, 1.2), 0.2, rate, phase));
        figure.part(elbow, capsule(DVec3::ZERO, -z * arm * 0.85, 0.027 * h, 0.02 * h, 8).with(sleeves));
        figure.part(elbow, sphere(0.03 * h, 10, 6).moved(-z * arm).with(skin));
    }
    if random.chance(0.3) {
        let bag = kit.slot(palette::cloth(random, &photos));
        let size = DVec3::new(0.1, random.range(0.12, 0.2), random.range(0.15, 0.26)) * h;
        figure.part(chest, rounded(size, 0.03 * h).moved(DVec3::new(-0.11, 0.0, 0.17) * h).with(bag));
    }
    Actor { motion, joints: figure.joints, parts: figure.parts }
}

/// A four-legged animal of this height at the shoulder.
pub(crate) fn animal(kit: &mut Kit, random: &mut Random, height: f64, speed: f64, motion: Motion) -> Actor {
    let h = height;
    let rate = 1.5 * speed.max(0.15) / (h * 0.5);
    let base = palette::hsv(random.range(0.03, 0.12), random.range(0.0, 0.6), random.range(0.1, 0.9));
    let other = palette::hsv(random.range(0.03, 0.12), random.range(0.0, 0.5), random.range(0.1, 0.9));
    let pattern = if random.chance(0.6) { crate::material::Pattern::Clouds } else { crate::material::Pattern::Plain };
    let fur = kit.slot(crate::material::Material {
        pattern,
        colours: [base, other, base],
        scale: (h * random.range(0.2, 0.8)) as f32,
        seed: random.bits() as u32,
        rough: 1.0,
        ..crate::material::Material::plain(base)
    });
    let dark = kit.slot(palette::paint(random));
    let mut figure = Figure::default();
    let (y, z) = (DVec3::Y, DVec3::Z);
    let long = random.range(0.4, 0.65) * h;
    let thick = random.range(0.18, 0.28) * h;
    let spine = figure.joint(None, z * 0.75 * h, y, swing(0.0, 0.05, rate * 2.0, 0.0));
    figure.part(
        spine,
        capsule(DVec3::new(-long, 0.0, 0.0), DVec3::new(long, 0.0, 0.02 * h), thick * 0.9, thick, 14).with(fur),
    );
    let neck = figure.joint(Some(spine), DVec3::new(long, 0.0, 0.1 * h), y, swing(-0.3, 0.15, rate, 0.5));
    let head_at = DVec3::new(0.3, 0.0, 0.3) * h;
    let mut head = capsule(DVec3::ZERO, head_at, thick * 0.6, thick * 0.5, 10).with(fur);
    head.add(&capsule(head_at, head_at + DVec3::new(0.25, 0.0, -0.05) * h, 0.15 * h, 0.07 * h, 10).with(fur));
    head.add(&sphere(0.04 * h, 8, 5).moved(head_at + DVec3::new(0.32, 0.0, -0.05) * h).with(dark));
    for side in [-1.0, 1.0] {
        let ear = head_at + DVec3::new(0.0, side * 0.09, 0.1) * h;
        head.add(&capsule(ear, ear + DVec3::new(-0.03, side * 0.03, 0.14) * h, 0.05 * h, 0.02 * h, 8).with(fur));
    }
    figure.part(neck, head);
    let tail = figure.joint(Some(spine), DVec3::new(-long, 0.0, 0.1 * h), z, swing(0.0, 0.6, rate * 1.7, 0.0));
    figure.part(tail, capsule(DVec3::ZERO, DVec3::new(-0.4, 0.0, 0.25) * h, 0.05 * h, 0.025 * h, 8).with(fur));
    for (end, side, phase) in [(-0.85, -1.0, 0.0), (-0.85, 1.0, 3.1), (0.9, -1.0, 3.6), (0.9, 1.0, 0.5)] {
        let hip = figure.joint(
            Some(spine),
            DVec3::new(end * long, side * thick * 0.6, -0.1 * h),
            y,
            swing(0.0, 0.45, rate, phase),
        );
        figure.part(hip, capsule(DVec3::ZERO, -z * 0.32 * h, 0.09 * h, 0.055 * h, 8).with(fur));
        let knee = figure.joint(Some(hip), -z * 0.32 * h, y, swing(0.25, 0.25, rate, phase - 1.5));
        figure.part(knee, capsule(DVec3::ZERO, -z * 0.28 * h, 0.055 * h, 0.04 * h, 8).with(fur));
    }
    Actor { motion, joints: figure.joints, parts: figure.parts }
}

/// A path over a floor from one side to the other by way of a few points near the middle.
pub(crate) fn way(random: &mut Random, low: DVec2, high: DVec2, z: f64, length: f64) -> Vec<DVec3> {
    let mut at = random.inside(low, high);
    let mut heading = random.range(0.0, std::f64::consts::TAU);
    let mut points = vec![at.extend(z)];
    for _ in 0..3 {
        heading += random.range(-0.8, 0.8);
        // Turns back to the middle at the border.
        let ahead = at + DVec2::from_angle(heading) * length / 3.0;
        if ahead.cmplt(low).any() || ahead.cmpgt(high).any() {
            let home = (low + high) / 2.0 - at;
            heading = home.y.atan2(home.x) + random.range(-0.5, 0.5);
        }
        at += DVec2::from_angle(heading) * length / 3.0;
        points.push(at.extend(z));
    }
    points
}
