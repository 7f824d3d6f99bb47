//! Small things: what stands on tables and shelves, and what is thrown about.

use glam::{DQuat, DVec2, DVec3};

use crate::mesh::Mesh;
use crate::palette;
use crate::random::Random;
use crate::shapes::{
    block, capsule, cone, cuboid, cylinder, lathe, prism, rock, rounded, sphere, superquadric, torus, tube,
};
use crate::things::Kit;
use crate::things::imported::small;

/// A thing of about this height or width in metres, made or imported.
pub(crate) fn object(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    if let Some(mesh) = small(kit, random, size) {
        return mesh;
    }
    let kind = random.weighted(&[1.5, 1.5, 1.2, 1.2, 1.0, 1.0, 0.8, 0.8, 1.0, 0.7, 0.8, 0.7, 0.7, 0.7]);
    let mesh = match kind {
        0 => package(kit, random, size),
        1 => books(kit, random, size),
        2 => vessel(kit, random, size),
        3 => bottle(kit, random, size),
        4 => mug(kit, random, size * 0.6),
        5 => ball(kit, random, size * 0.5),
        6 => screen(kit, random, size * 1.6),
        7 => desk_lamp(kit, random, size * 1.6),
        8 => {
            let exponents = [random.range(0.15, 1.8), random.range(0.15, 1.8)];
            let axes = DVec3::new(random.range(0.2, 0.5), random.range(0.2, 0.5), random.range(0.2, 0.5)) * size;
            let material = palette::any(random, &kit.photos);
            kit.made(superquadric(axes, exponents, 20, 10), material)
        }
        9 => {
            let (rough, seed) = (random.range(0.15, 0.5), random.bits() as u32);
            let material = palette::any(random, &kit.photos);
            kit.made(rock(size * 0.4, rough, 10, seed), material)
        }
        10 => toy(kit, random, size),
        11 => {
            let material = palette::any(random, &kit.photos);
            let ring = torus(size * 0.35, size * random.range(0.06, 0.14), 20, 10);
            kit.made(ring, material).rotated(DQuat::from_rotation_x(random.range(0.0, 1.57)))
        }
        12 => fruit(kit, random, size * 0.5),
        _ => {
            let sides = random.count(3, 8);
            let outline: Vec<DVec2> = (0..sides)
                .map(|k| {
                    DVec2::from_angle(k as f64 / sides as f64 * std::f64::consts::TAU) * size * random.range(0.25, 0.5)
                })
                .collect();
            let material = palette::any(random, &kit.photos);
            kit.made(prism(&outline, size * random.range(0.2, 0.9)), material)
        }
    };
    mesh.grounded()
}

/// A box with a printed surface.
fn package(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let sides = DVec3::new(random.range(0.4, 1.0), random.range(0.25, 0.9), random.range(0.2, 1.0)) * size;
    let material = match random.below(4) {
        0 => palette::poster(random, &kit.photos, sides.x, sides.z),
        1 => palette::text(random),
        2 => palette::paint(random),
        _ => palette::any(random, &kit.photos),
    };
    let mesh =
        if random.chance(0.4) { rounded(sides, sides.min_element() * random.range(0.02, 0.3)) } else { cuboid(sides) };
    kit.made(mesh, material)
}

fn books(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let mut stack = Mesh::default();
    let mut z = 0.0;
    for _ in 0..random.count(1, 5) {
        let sides = DVec3::new(random.range(0.7, 1.0), random.range(0.5, 0.75), random.range(0.06, 0.2)) * size;
        let cover = if random.chance(0.4) {
            palette::poster(random, &kit.photos, sides.x, sides.y)
        } else {
            palette::paint(random)
        };
        let cover = kit.slot(cover);
        let paper = kit.slot(palette::white(random));
        let pages = cuboid(sides * DVec3::new(0.97, 0.97, 0.8)).with(paper);
        let board = |z: f64| cuboid(sides * DVec3::new(1.0, 1.0, 0.1)).moved(DVec3::new(0.0, 0.0, z)).with(cover);
        let spine = cuboid(sides * DVec3::new(0.02, 1.0, 1.0)).moved(DVec3::new(-sides.x * 0.49, 0.0, 0.0)).with(cover);
        let book = Mesh::joined(&[pages, board(sides.z * 0.45), board(-sides.z * 0.45), spine]);
        stack.add(&book.turned(random.range(-0.5, 0.5)).moved(DVec3::new(0.0, 0.0, z + sides.z / 2.0)));
        z += sides.z;
    }
    stack
}

/// A vase, bowl or pot: a wall of its own thickness about a hollow.
fn vessel(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let height = size * random.range(0.3, 1.0);
    let knots: Vec<f64> = (0..4).map(|_| size * random.range(0.15, 0.45)).collect();
    let radius = |s: f64| {
        let x = s * 3.0;
        let k = (x as usize).min(2);
        let f = x - k as f64;
        knots[k] + (knots[k + 1] - knots[k]) * f * f * (3.0 - 2.0 * f)
    };
    let steps = 9;
    let wall = 0.03 * size;
    let mut profile = vec![DVec2::new(0.0, 0.0), DVec2::new(radius(0.0), 0.0), DVec2::new(radius(0.0), 0.0)];
    profile.extend((1..=steps).map(|k| k as f64 / steps as f64).map(|s| DVec2::new(radius(s), s * height)));
    profile
        .extend((1..=steps).rev().map(|k| k as f64 / steps as f64).map(|s| DVec2::new(radius(s) - wall, s * height)));
    profile.push(DVec2::new(0.0, wall));
    let material = palette::any(random, &kit.photos);
    kit.made(lathe(&profile, 24), material)
}

fn bottle(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let (radius, neck) = (size * random.range(0.12, 0.2), size * random.range(0.03, 0.06));
    let shoulder = size * random.range(0.5, 0.75);
    let p = |r: f64, z: f64| DVec2::new(r, z);
    let profile = [
        p(0.0, 0.0),
        p(radius, 0.0),
        p(radius, 0.0),
        p(radius, shoulder),
        p(radius * 0.8, shoulder + 0.08 * size),
        p(neck, shoulder + 0.16 * size),
        p(neck, size),
        p(neck, size),
        p(0.0, size),
    ];
    let glass = kit.slot(palette::paint(random));
    let mut bottle = lathe(&profile, 20).with(glass);
    let label = palette::poster(random, &kit.photos, radius * 2.0, radius * 2.0);
    let label = kit.made(cylinder(radius * 1.01, shoulder * 0.5, 20), label);
    bottle.add(&label.moved(DVec3::new(0.0, 0.0, shoulder * 0.25)));
    bottle
}

fn mug(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let (r, h) = (size * random.range(0.35, 0.5), size * random.range(0.7, 1.1));
    let p = |r: f64, z: f64| DVec2::new(r, z);
    let profile = [
        p(0.0, 0.0),
        p(r, 0.0),
        p(r, 0.0),
        p(r, h),
        p(r * 0.9, h),
        p(r * 0.9, h),
        p(r * 0.85, h * 0.1),
        p(0.0, h * 0.1),
    ];
    let slot = kit.slot(palette::any(random, &kit.photos.clone()));
    let handle: Vec<DVec3> = (0..9)
        .map(|k| (k as f64 / 8.0 - 0.5) * 3.0)
        .map(|a| DVec3::new(r + r * 0.6 * a.cos(), 0.0, h * 0.5 + h * 0.33 * a.sin()))
        .collect();
    Mesh::joined(&[lathe(&profile, 20), tube(&handle, &[r * 0.12; 9], 7)]).with(slot).turned(random.range(0.0, 6.3))
}

fn ball(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let material = palette::any(random, &kit.photos);
    kit.made(sphere(size * random.range(0.5, 1.0), 24, 12), material)
}

/// A monitor or an open laptop with a glowing picture.
fn screen(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let (w, h) = (size * random.range(0.7, 1.0), size * random.range(0.4, 0.6));
    let casing = kit.slot(palette::paint(random));
    let mut picture = palette::poster(random, &kit.photos, w, h);
    picture.glow = random.range(0.0, 1.5) as f32;
    picture.rough = 0.1;
    let mut mesh = cuboid(DVec3::new(w, 0.03 * size, h)).with(casing);
    let face = cuboid(DVec3::new(w * 0.95, 0.002 * size, h * 0.92)).moved(DVec3::new(0.0, -0.016 * size, 0.0));
    mesh.add(&kit.made(face, picture));
    let mut mesh = mesh.rotated(DQuat::from_rotation_x(random.range(-0.35, 0.0)));
    if random.chance(0.5) {
        let keys = cuboid(DVec3::new(w, h, 0.03 * size)).moved(DVec3::new(0.0, -h * 0.5, -h * 0.5)).with(casing);
        mesh.add(&keys);
    } else {
        mesh.add(
            &block(DVec3::new(-0.05, 0.02, -0.8 * h / size) * size, DVec3::new(0.05, 0.06, 0.0) * size).with(casing),
        );
        mesh.add(&cylinder(0.2 * size, 0.02 * size, 18).moved(DVec3::new(0.0, 0.04 * size, -0.8 * h)).with(casing));
    }
    mesh.turned(random.range(-0.6, 0.6))
}

fn desk_lamp(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let metal = kit.slot(palette::metal(random));
    let shade = kit.slot(palette::paint(random));
    let bend = DVec3::new(size * random.range(-0.2, 0.2), 0.0, size * random.range(0.4, 0.6));
    let head = bend + DVec3::new(size * random.range(0.15, 0.35), 0.0, size * random.range(0.1, 0.3));
    let turn = DQuat::from_rotation_y(random.range(-0.8, 0.2));
    Mesh::joined(&[
        cylinder(size * 0.14, size * 0.03, 18).with(metal),
        tube(&[DVec3::ZERO, bend, head], &[size * 0.015; 3], 6).with(metal),
        cone(size * 0.13, size * 0.05, size * 0.16, 16).rotated(turn).moved(head - DVec3::Z * size * 0.1).with(shade),
    ])
    .turned(random.range(0.0, 6.3))
}

/// A few blocks, balls and sticks put together.
fn toy(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let mut toy = Mesh::default();
    for _ in 0..random.count(2, 5) {
        let at = random.direction() * size * 0.25;
        let own = size * random.range(0.1, 0.3);
        let part = match random.below(4) {
            0 => rounded(
                DVec3::new(random.range(0.5, 2.0), random.range(0.5, 2.0), random.range(0.5, 2.0)) * own,
                own * 0.1,
            ),
            1 => sphere(own, 16, 8),
            2 => capsule(DVec3::ZERO, random.direction() * own * 2.0, own * 0.4, own * 0.3, 12),
            _ => cone(own, own * random.range(0.0, 1.0), own * 2.0, 16),
        };
        let material = palette::paint(random);
        toy.add(&kit.made(part, material).rotated(random.rotation()).moved(at));
    }
    toy
}

fn fruit(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let base = palette::hsv(random.range(0.0, 0.3), random.range(0.5, 0.95), random.range(0.5, 0.95));
    let slot =
        kit.slot(crate::material::Material { rough: 0.35, stain: 0.2, ..crate::material::Material::plain(base) });
    let mut pile = Mesh::default();
    for k in 0..random.count(1, 4) {
        let angle = k as f64 * 2.1 + random.unit();
        let at = if k == 0 { DVec3::ZERO } else { DVec3::new(angle.cos(), angle.sin(), 0.0) * size * 0.8 };
        let shape = DVec3::new(1.0, 1.0, random.range(0.8, 1.3)) * size * 0.45;
        pile.add(&superquadric(shape, [1.0, random.range(0.85, 1.15)], 16, 8).moved(at).grounded().with(slot));
    }
    pile
}
