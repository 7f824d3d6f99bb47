//! Things that move, by a draw: what they are, how they move, how fast.

use std::sync::Arc;

use glam::{DQuat, DVec2, DVec3};

use crate::actor::{Actor, Change, Deform, DeformKind, Part};
use crate::cast::Solid;
use crate::mesh::Mesh;
use crate::motion::{Angle, Clock, Joint, Motion, Track, Turn};
use crate::palette;
use crate::random::Random;
use crate::shapes::{block, capsule, cuboid, cylinder, lathe, rock, rounded, sheet, sphere};
use crate::things::walker::way;
use crate::things::{Arena, Kit, animal, figure, object, walker};

/// Something that moves; an imported model with the given probability, where there are some that fit.
pub(crate) fn mover(kit: &mut Kit, random: &mut Random, arena: &Arena, imported: f64) -> Actor {
    let imported = !kit.models.is_empty() && random.fork("imported").chance(imported);
    if imported && let Some(actor) = figure(kit, &mut random.fork("figure"), arena) {
        return actor;
    }
    // Of what moves, this draw decides alone whether it is a model.
    let share = std::mem::replace(&mut kit.share, if imported { 1.0 } else { 0.0 });
    let actor = if imported { thing(kit, random, arena) } else { drawn(kit, random, arena) };
    kit.share = share;
    actor
}

/// A small thing that moves as a whole.
fn thing(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    match random.weighted(&[1.5, 1.0, 0.6, 0.6, 0.8, 1.5]) {
        0 => carried(kit, random, arena),
        1 => thrown(kit, random, arena),
        2 => swinging(kit, random, arena),
        3 => hovering(kit, random, arena),
        4 => spinning(kit, random, arena),
        _ => sliding(kit, random, arena),
    }
}

fn drawn(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let people = if arena.people { 1.0 } else { 0.0 };
    match random.weighted(&[2.5 * people, 0.8 * people, 1.6, 1.0, 1.3, 0.8, 0.8, 0.8, 1.0, 0.7, 0.7, 0.5, 0.6, 0.9]) {
        0 => {
            let speed = if random.chance(0.2) { 0.0 } else { random.range(0.5, 2.0) };
            let motion = arena.strolling(random, speed);
            let height = if random.chance(0.15) { random.range(0.9, 1.4) } else { random.range(1.5, 1.95) };
            walker(kit, random, height, speed, motion)
        }
        1 => {
            let speed = random.range(0.2, 1.5);
            let motion = arena.strolling(random, speed);
            let height = random.log_range(0.25, 0.7);
            animal(kit, random, height, speed, motion)
        }
        2 => carried(kit, random, arena),
        3 => rolling(kit, random, arena),
        4 => thrown(kit, random, arena),
        5 => swinging(kit, random, arena),
        6 => hovering(kit, random, arena),
        7 => arm(kit, random, arena),
        8 => soft(kit, random, arena),
        9 => flag(kit, random, arena),
        10 => spinning(kit, random, arena),
        11 => fan(kit, random, arena),
        12 => chest(kit, random, arena),
        _ => sliding(kit, random, arena),
    }
}

/// Through the air along a curve, as if by an invisible hand.
fn carried(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random);
    let mesh = centred(object(kit, random, size));
    let length = arena.distance(random);
    let mut at = arena.point(random, [0.15, 0.6]);
    let mut points = vec![at];
    let aim = (arena.point(random, [0.2, 0.5]) - at).normalize_or(DVec3::X);
    for _ in 0..3 {
        at += (aim + random.direction() * 0.6) * length / 3.0;
        at.z = at.z.clamp(arena.floor + size * 0.6, arena.floor + arena.tall);
        points.push(at);
    }
    let turn = Turn::Spin { axis: random.direction(), rate: random.log_range(0.05, 4.0), first: random.rotation() };
    let clock = arena.clock(random);
    rigid(mesh, Motion { track: Track::Spline { points, seconds: arena.seconds }, turn, clock })
}

fn rolling(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let radius = arena.size(random) * 0.4;
    let material = palette::any(random, &kit.photos);
    let mesh = kit.made(sphere(radius, 24, 12), material);
    let length = arena.distance(random);
    let points = way(random, arena.low, arena.high, arena.floor + radius, length);
    let clock = arena.clock(random);
    rigid(mesh, Motion { track: Track::Spline { points, seconds: arena.seconds }, turn: Turn::Roll(radius), clock })
}

fn sliding(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random);
    let mesh = object(kit, random, size);
    let length = arena.distance(random);
    let points = way(random, arena.low, arena.high, arena.floor, length);
    let turn = if random.chance(0.5) {
        Turn::Ahead
    } else {
        Turn::Spin { axis: DVec3::Z, rate: random.range(-2.0, 2.0), first: DQuat::IDENTITY }
    };
    let clock = arena.clock(random);
    rigid(mesh, Motion { track: Track::Spline { points, seconds: arena.seconds }, turn, clock })
}

fn thrown(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random) * 0.8;
    let mesh = centred(object(kit, random, size));
    let from = arena.point(random, [0.2, 0.8]);
    let aim = (arena.middle() - from).with_z(0.0).normalize_or(DVec3::X);
    let fast = (arena.distance(random) / arena.seconds).min(4.0);
    // In a small arena a natural flight is over before the second picture.
    let velocity = aim * fast + DVec3::Z * random.range(0.0, 3.0) * (arena.tall / 2.5).min(1.0);
    let track = Track::Thrown { from, velocity, floor: arena.floor + size * 0.4, bounce: random.range(0.3, 0.8) };
    let turn = Turn::Spin { axis: random.direction(), rate: random.range(0.0, 8.0), first: random.rotation() };
    let start = if random.chance(0.5) { 0.0 } else { random.range(0.0, 0.5) * arena.seconds };
    rigid(mesh, Motion { track, turn, clock: Clock { start, stop: f64::INFINITY } })
}

fn swinging(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random);
    let arm = arena.tall * random.range(0.3, 0.6);
    let mut mesh = centred(object(kit, random, size));
    let rope = kit.slot(palette::metal(random));
    mesh.add(&cylinder(0.01 * arm.max(size), arm, 6).with(rope));
    let pivot = arena.point(random, [0.9, 0.9]);
    let axis = DVec2::from_angle(random.range(0.0, 6.3)).extend(0.0);
    let angle =
        Angle::Sine { mean: 0.0, by: random.range(0.2, 1.0), rate: (9.81 / arm).sqrt(), phase: random.range(0.0, 6.3) };
    rigid(
        mesh,
        Motion {
            track: Track::Swing { pivot, arm, axis, angle },
            turn: Turn::Fixed(DQuat::IDENTITY),
            clock: Clock::ALWAYS,
        },
    )
}

fn hovering(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random);
    let mesh = centred(object(kit, random, size));
    let centre = arena.point(random, [0.25, 0.6]);
    let by = DVec3::splat(arena.width()) * random.log_range(0.03, 0.3);
    let (rate, phase) = (random.log_range(0.8, 6.0), random.range(0.0, 20.0));
    let turn = Turn::Spin { axis: random.direction(), rate: random.range(0.0, 2.0), first: random.rotation() };
    rigid(mesh, Motion { track: Track::Hover { centre, by, rate, phase }, turn, clock: Clock::ALWAYS })
}

fn spinning(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random) * 1.2;
    let mesh = object(kit, random, size);
    let rate = random.log_range(0.3, 8.0) * random.sign();
    let turn = Turn::Spin { axis: DVec3::Z, rate, first: DQuat::IDENTITY };
    let clock = arena.clock(random);
    rigid(mesh, Motion { track: Track::Fixed(arena.point(random, [0.0, 0.0])), turn, clock })
}

/// A robot's arm: three to five links, each turning on the one before.
fn arm(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let reach = arena.width() * random.range(0.3, 0.6);
    let (shell, dark) = (kit.slot(palette::paint(random)), kit.slot(palette::metal(random)));
    let links = random.count(3, 5);
    let length = reach / links as f64 * 1.3;
    let mut joints = Vec::new();
    let mut parts = Vec::new();
    let foot = cylinder(length * 0.4, length * 0.25, 20).with(dark);
    parts.push(Part { solid: Arc::new(Solid::new(foot)), joint: None, change: None });
    for k in 0..links {
        let axis = if k == 0 { DVec3::Z } else { DVec3::Y };
        let by = random.range(0.1, 0.7);
        let mean = if k == 0 { random.range(0.0, 6.3) } else { random.range(-0.3, 0.9) };
        let angle = Angle::Sine { mean, by, rate: random.log_range(0.7, 4.0), phase: random.range(0.0, 6.3) };
        let place = DVec3::Z * if k == 0 { length * 0.25 } else { length };
        joints.push(Joint { parent: k.checked_sub(1), place, axis, angle, slides: false });
        let thick = length * 0.2 * (1.0 - 0.12 * k as f64);
        let mut link = capsule(DVec3::ZERO, DVec3::Z * length, thick, thick * 0.8, 12).with(shell);
        let hub = cylinder(thick * 1.15, thick * 2.6, 16).moved(-DVec3::Z * thick * 1.3);
        link.add(&hub.rotated(DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2)).with(dark));
        if k + 1 == links {
            for side in [-1.0, 1.0] {
                let at = DVec3::new(0.0, side * thick * 0.7, length * 1.2);
                link.add(&cuboid(DVec3::new(thick * 0.5, thick * 0.25, thick * 2.0)).moved(at).with(dark));
            }
        }
        parts.push(Part { solid: Arc::new(Solid::new(link)), joint: Some(k), change: None });
    }
    let motion = Motion::fixed(arena.point(random, [0.0, 0.0]));
    Actor { motion, joints, parts }
}

/// A fan: blades that turn on an axle before a stand.
fn fan(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random) * 1.3;
    let (shell, blade) = (kit.slot(palette::paint(random)), kit.slot(palette::any(random, &kit.photos.clone())));
    let (high, count) = (size * random.range(0.7, 1.2), random.count(2, 6));
    let stand = Mesh::joined(&[cylinder(size * 0.25, size * 0.05, 20), cylinder(size * 0.04, high, 10)]).with(shell);
    let quarter = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
    let mut wheel = cylinder(size * 0.09, size * 0.12, 14).rotated(quarter).with(shell);
    for k in 0..count {
        let turn = DQuat::from_rotation_y(std::f64::consts::TAU * k as f64 / count as f64);
        let wing = cuboid(DVec3::new(size * 0.4, size * 0.015, size * 0.14)).rotated(DQuat::from_rotation_x(0.4));
        wheel.add(&wing.moved(DVec3::new(size * 0.26, -size * 0.06, 0.0)).rotated(turn).with(blade));
    }
    let angle = Angle::Steady { rate: random.log_range(0.5, 12.0) * random.sign(), phase: random.range(0.0, 6.3) };
    let place = DVec3::new(0.0, -size * 0.05, high);
    let part = |mesh, joint| Part { solid: Arc::new(Solid::new(mesh)), joint, change: None };
    let motion = Motion {
        track: Track::Fixed(arena.point(random, [0.0, 0.0])),
        turn: Turn::Fixed(DQuat::from_rotation_z(random.range(0.0, 6.3))),
        clock: arena.clock(random),
    };
    let joints = vec![Joint { parent: None, place, axis: DVec3::Y, angle, slides: false }];
    Actor { motion, joints, parts: vec![part(stand, None), part(wheel, Some(0))] }
}

/// A box whose lid turns on its hinge and whose drawer slides out.
fn chest(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random) * 1.2;
    let half = DVec3::new(random.range(0.4, 0.8), random.range(0.3, 0.5), random.range(0.25, 0.6)) * size;
    let (body, inner) = (kit.slot(palette::any(random, &kit.photos.clone())), kit.slot(palette::paint(random)));
    let wall = half.min_element() * 0.08;
    let side = |low: DVec3, high: DVec3| block(low * half, high * half);
    let mut shell = side(DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, 1.0, 1.1));
    shell.add(&side(DVec3::new(-1.0, -1.0, 0.0), DVec3::new(1.0, 1.0, 0.1)));
    for (low, high) in [
        (DVec3::new(-1.0, -1.0, 0.0), DVec3::new(-0.92, 1.0, 2.0)),
        (DVec3::new(0.92, -1.0, 0.0), DVec3::new(1.0, 1.0, 2.0)),
        (DVec3::new(-1.0, 0.92, 0.0), DVec3::new(1.0, 1.0, 2.0)),
        (DVec3::new(-1.0, -1.0, 1.0), DVec3::new(1.0, -0.92, 2.0)),
    ] {
        shell.add(&side(low, high));
    }
    let lid = block(DVec3::new(-half.x, -2.0 * half.y, 0.0), DVec3::new(half.x, 0.0, wall));
    let (depth, front) = (half.y * 1.8, half.x * 0.9);
    let mut drawer = block(DVec3::new(-front, -wall, -half.z * 0.4), DVec3::new(front, 0.0, half.z * 0.4)).with(body);
    drawer.add(&block(DVec3::new(-front, 0.0, -half.z * 0.4), DVec3::new(front, depth, -half.z * 0.3)).with(inner));
    drawer.add(&sphere(wall * 1.5, 10, 6).moved(DVec3::new(0.0, -wall * 2.0, 0.0)).with(inner));
    let open = |random: &mut Random, most: f64| {
        let start = random.range(0.0, 0.3) * arena.seconds;
        let [from, to] = if random.chance(0.5) { [0.0, most] } else { [most, 0.0] };
        Angle::Once { from, to, seconds: [start, start + random.range(0.4, 1.0) * arena.seconds] }
    };
    let turn = random.range(0.6, 2.0);
    let joints = vec![
        Joint {
            parent: None,
            place: DVec3::new(0.0, half.y, half.z * 2.0),
            axis: DVec3::NEG_X,
            angle: open(random, turn),
            slides: false,
        },
        Joint {
            parent: None,
            place: DVec3::new(0.0, -half.y, half.z * 0.55),
            axis: DVec3::NEG_Y,
            angle: open(random, depth * 0.8),
            slides: true,
        },
    ];
    let part = |mesh, joint| Part { solid: Arc::new(Solid::new(mesh)), joint, change: None };
    let motion = Motion {
        track: Track::Fixed(arena.point(random, [0.0, 0.0])),
        turn: Turn::Fixed(DQuat::from_rotation_z(random.range(0.0, 6.3))),
        clock: Clock::ALWAYS,
    };
    Actor {
        motion,
        joints,
        parts: vec![part(shell.with(body), None), part(lid.with(body), Some(0)), part(drawer, Some(1))],
    }
}

/// Something that changes its shape.
fn soft(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random);
    let material = palette::any(random, &kit.photos);
    let photos = kit.photos.clone();
    let (kind, mesh) = match random.below(5) {
        0 => (DeformKind::Bend, tall(random, size)),
        1 => (DeformKind::Twist, tall(random, size)),
        2 => (DeformKind::Pulse, sphere(size * 0.5, 24, 12)),
        3 => (DeformKind::Wobble, rock(size * 0.5, 0.2, 12, random.bits() as u32)),
        _ => (DeformKind::Pulse, rounded(DVec3::new(0.5, 0.6, 0.7) * size, 0.1 * size)),
    };
    let by = match kind {
        DeformKind::Bend => random.range(0.2, 0.8),
        DeformKind::Twist => random.range(0.5, 2.0),
        _ => random.range(0.08, 0.3),
    };
    let material = if random.chance(0.3) { palette::cloth(random, &photos) } else { material };
    let solid = Arc::new(Solid::new(kit.made(mesh, material)));
    let deform = Deform { kind, by, rate: random.log_range(1.5, 8.0), phase: random.range(0.0, 6.3), size };
    let low = solid.mesh.bounds()[0].z;
    let motion = if random.chance(0.5) {
        let point = arena.point(random, [0.0, 0.0]) - DVec3::Z * low;
        Motion::fixed(point)
    } else {
        let length = arena.distance(random);
        let points = way(random, arena.low, arena.high, arena.floor - low, length);
        Motion { track: Track::Spline { points, seconds: arena.seconds }, turn: Turn::Ahead, clock: Clock::ALWAYS }
    };
    Actor { motion, joints: Vec::new(), parts: vec![Part { solid, joint: None, change: Some(Change::Soft(deform)) }] }
}

/// A column of many rings.
fn tall(random: &mut Random, size: f64) -> Mesh {
    let (radius, belly) = (size * random.range(0.12, 0.25), random.range(-0.4, 0.6));
    let ring = |k: usize| {
        let s = k as f64 / 14.0;
        DVec2::new(radius * (1.0 + belly * (s * std::f64::consts::PI).sin()), s * size * 1.2)
    };
    let mut profile = vec![DVec2::ZERO];
    profile.extend((0..=14).map(ring));
    profile.push(DVec2::new(0.0, size * 1.2));
    lathe(&profile, if random.chance(0.4) { 4 } else { 18 })
}

/// A cloth in the wind, on a pole.
fn flag(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Actor {
    let size = arena.size(random) * 1.5;
    let cloth = if random.chance(0.5) {
        palette::cloth(random, &kit.photos)
    } else {
        palette::poster(random, &kit.photos, size, size)
    };
    let upright = sheet(DVec2::new(size, size * 0.7), [18, 10], |p| DVec3::new(p.x + size / 2.0, 0.0, p.y));
    let deform = Deform {
        kind: DeformKind::Wave,
        by: size * random.range(0.04, 0.14),
        rate: random.log_range(3.0, 9.0),
        phase: random.range(0.0, 6.3),
        size,
    };
    let cloth =
        Part { solid: Arc::new(Solid::new(kit.made(upright, cloth))), joint: None, change: Some(Change::Soft(deform)) };
    let high = size * random.range(0.6, 1.2);
    let metal = palette::metal(random);
    let pole = block(DVec3::new(-0.02 * size, -0.02 * size, -high), DVec3::new(0.0, 0.02 * size, size * 0.4));
    let pole = Part { solid: Arc::new(Solid::new(kit.made(pole, metal))), joint: None, change: None };
    let turn = Turn::Fixed(DQuat::from_rotation_z(random.range(0.0, 6.3)));
    let track = Track::Fixed(arena.point(random, [0.0, 0.0]) + DVec3::Z * high);
    let motion = Motion { track, turn, clock: Clock::ALWAYS };
    Actor { motion, joints: Vec::new(), parts: vec![cloth, pole] }
}

fn rigid(mesh: Mesh, motion: Motion) -> Actor {
    Actor::rigid(Arc::new(Solid::new(mesh)), motion)
}

/// Moved so that the middle of its box is the origin.
fn centred(mesh: Mesh) -> Mesh {
    let [low, high] = mesh.bounds();
    mesh.moved(-(low + high) / 2.0)
}
