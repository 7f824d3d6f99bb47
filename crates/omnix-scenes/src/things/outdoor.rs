//! Things of streets, parks and fields.

use glam::{DQuat, DVec3};

use crate::mesh::Mesh;
use crate::palette;
use crate::random::Random;
use crate::shapes::{blade, block, cone, cuboid, cylinder, rock, rounded, tube};
use crate::things::Kit;

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// A tree: a bent trunk and clumps of leaves, or a conifer.
pub(crate) fn tree(kit: &mut Kit, random: &mut Random, height: f64) -> Mesh {
    let bark = palette::wood(random, false);
    let bark = kit.slot(bark);
    let green = kit.slot(palette::leaves(random));
    let lean = random.direction().with_z(0.0) * height * 0.06;
    let path = [DVec3::ZERO, lean * 0.5 + at(0.0, 0.0, height * 0.3), lean + at(0.0, 0.0, height * 0.75)];
    let thick = height * random.range(0.015, 0.035);
    let mut mesh = tube(&path, &[thick * 1.3, thick, thick * 0.4], 8).with(bark);
    if random.chance(0.25) {
        for k in 0..5 {
            let s = k as f64 / 5.0;
            let skirt = cone(height * 0.24 * (1.0 - s), height * 0.03, height * 0.28, 12);
            mesh.add(&skirt.moved(lean * s + at(0.0, 0.0, height * (0.2 + 0.16 * k as f64))).with(green));
        }
        return mesh;
    }
    for _ in 0..random.count(5, 9) {
        let centre = lean + random.direction() * height * 0.22 + at(0.0, 0.0, height * 0.75);
        let clump = rock(height * random.range(0.12, 0.22), 0.45, 8, random.bits() as u32);
        mesh.add(&clump.moved(centre).with(green));
        // Loose leaves break the outline.
        for _ in 0..14 {
            let out = random.direction();
            let leaf = blade(out * height * 0.05, height * 0.02, 0.3, 2);
            mesh.add(&leaf.moved(centre + out * height * 0.17).with(green));
        }
    }
    mesh
}

pub(crate) fn bush(kit: &mut Kit, random: &mut Random, size: f64) -> Mesh {
    let green = kit.slot(palette::leaves(random));
    let mut mesh = Mesh::default();
    for _ in 0..random.count(2, 5) {
        let place = at(random.range(-0.4, 0.4), random.range(-0.4, 0.4), random.range(0.1, 0.5)) * size;
        mesh.add(&rock(size * random.range(0.25, 0.45), 0.5, 8, random.bits() as u32).moved(place).with(green));
    }
    for _ in 0..40 {
        let out = random.direction();
        let out = out.with_z(out.z.abs());
        mesh.add(&blade(out * size * 0.3, size * 0.06, 0.4, 3).moved(out * size * 0.35).with(green));
    }
    mesh
}

/// A house from corner (0, 0) along x, its front at y = 0 towards -y.
pub(crate) fn house(kit: &mut Kit, random: &mut Random, width: f64) -> Mesh {
    let photos = kit.photos.clone();
    let wall = if random.chance(0.35) { palette::brick(random) } else { palette::wall(random, &photos) };
    let wall = kit.slot(wall);
    let trim = kit.slot(palette::white(random));
    let mut glass = palette::paint(random);
    glass.colours = [palette::hsv(0.58, 0.2, random.range(0.1, 0.4)); 3];
    (glass.rough, glass.gloss) = (0.05, 0.08);
    let glass = kit.slot(glass);
    let floors = random.count(1, 6);
    let storey = random.range(2.7, 3.6);
    let (height, depth) = (floors as f64 * storey, random.range(6.0, 10.0));
    let mut mesh = block(DVec3::ZERO, at(width, depth, height)).with(wall);
    let bays = (width / random.range(1.8, 3.2)).max(1.0) as usize;
    let bay = width / bays as f64;
    let (w, h) = (bay * random.range(0.35, 0.7), storey * random.range(0.4, 0.62));
    let door = random.below(bays);
    let paint = kit.slot(palette::paint(random));
    for floor in 0..floors {
        for k in 0..bays {
            let x = (k as f64 + 0.5) * bay;
            let z = floor as f64 * storey + storey * 0.55;
            if floor == 0 && k == door {
                mesh.add(&block(at(x - 0.5, -0.03, 0.0), at(x + 0.5, 0.02, 2.1)).with(paint));
                mesh.add(&block(at(x - 0.6, -0.06, 2.1), at(x + 0.6, 0.02, 2.25)).with(trim));
                continue;
            }
            let pane = |low: DVec3, high: DVec3| block(at(x, 0.0, z) + low, at(x, 0.0, z) + high);
            mesh.add(&pane(at(-w / 2.0, -0.012, -h / 2.0), at(w / 2.0, 0.02, h / 2.0)).with(glass));
            for (a, b) in [(-0.06, 0.02), (0.5, 0.54), (1.0, 1.06)] {
                let low = at(-w / 2.0 + w * a, -0.05, -h / 2.0);
                mesh.add(&pane(low, at(-w / 2.0 + w * b, 0.0, h / 2.0)).with(trim));
            }
            mesh.add(&pane(at(-w * 0.56, -0.14, -h / 2.0 - 0.1), at(w * 0.56, 0.0, -h / 2.0)).with(trim));
            mesh.add(&pane(at(-w * 0.54, -0.06, h / 2.0), at(w * 0.54, 0.0, h / 2.0 + 0.1)).with(trim));
        }
    }
    let tiles = palette::brick(random);
    let tiles = kit.slot(tiles);
    if random.chance(0.5) {
        let ridge = at(0.0, depth / 2.0, height + depth * random.range(0.2, 0.45));
        let along = at(width, 0.0, 0.0);
        let (front, back) = (at(0.0, -0.3, height), at(0.0, depth + 0.3, height));
        let mut roof = Mesh::default();
        roof.face([front, front + along, ridge + along, ridge]);
        roof.face([back + along, back, ridge, ridge + along]);
        for side in [DVec3::ZERO, along] {
            let corners = [front + side, back + side, ridge + side].map(|p| roof.vertex(p));
            roof.triangle(corners);
        }
        mesh.add(&roof.with(tiles));
    } else {
        mesh.add(&block(at(-0.1, -0.2, height), at(width + 0.1, depth, height + 0.35)).with(trim));
    }
    mesh
}

/// A car, its front towards +x; about 4.3 m long.
pub(crate) fn car(kit: &mut Kit, random: &mut Random) -> Mesh {
    let mut paint = palette::paint(random);
    (paint.rough, paint.gloss) = (0.12, 0.06);
    let paint = kit.slot(paint);
    let mut glass = palette::paint(random);
    glass.colours = [palette::hsv(0.6, 0.1, 0.12); 3];
    (glass.rough, glass.gloss) = (0.05, 0.08);
    let glass = kit.slot(glass);
    let (black, chrome) =
        (kit.slot(crate::material::Material::plain(glam::Vec3::splat(0.02))), kit.slot(palette::metal(random)));
    let lights = kit.slot(palette::glowing(palette::hsv(0.12, 0.1, 0.9), 0.6));
    let (length, width, waist) = (random.range(3.6, 4.8), random.range(1.65, 1.9), random.range(0.75, 0.95));
    let roof = waist + random.range(0.5, 0.9);
    let (l, w) = (length / 2.0, width / 2.0);
    let mut mesh = rounded(at(length, width, waist - 0.25), 0.14).moved(at(0.0, 0.0, (waist + 0.25) / 2.0)).with(paint);
    let (front, back) = (random.range(0.3, 0.6), random.range(0.4, 0.98));
    // The cabin: a block whose sides lean in.
    let mut cabin = cuboid(at(2.0, 2.0, 2.0));
    for p in cabin.positions.iter_mut() {
        let top = p.z > 0.0;
        let end = if p.x > 0.0 { l * front } else { -l * back };
        *p = at(
            if top { end * 0.72 } else { end },
            p.y * w * if top { 0.78 } else { 0.94 },
            if top { roof } else { waist - 0.05 },
        );
    }
    mesh.add(&cabin.settled().with(glass));
    let lid = rounded(at(l * (front + back) * 0.7, width * 0.8, 0.07), 0.03);
    mesh.add(&lid.moved(at(l * (front - back) * 0.36, 0.0, roof)).with(paint));
    for x in [-l * 0.62, l * 0.62] {
        for side in [-1.0, 1.0] {
            let turn = DQuat::from_rotation_x(std::f64::consts::FRAC_PI_2);
            let tyre = cylinder(0.32, 0.22, 20).rotated(turn).moved(at(x, side * (w - 0.1) + 0.11, 0.32));
            mesh.add(&tyre.with(black));
            let hub = cylinder(0.18, 0.24, 12).rotated(turn).moved(at(x, side * (w - 0.1) + 0.12, 0.32));
            mesh.add(&hub.with(chrome));
        }
    }
    for side in [-1.0, 1.0] {
        mesh.add(&rounded(at(0.1, 0.35, 0.14), 0.04).moved(at(l - 0.03, side * w * 0.65, waist - 0.18)).with(lights));
    }
    mesh
}

pub(crate) fn lamp_post(kit: &mut Kit, random: &mut Random) -> Mesh {
    let metal = kit.slot(palette::metal(random));
    let height = random.range(3.0, 7.0);
    let reach = at(random.range(0.3, 1.2), 0.0, 0.0);
    let top = at(0.0, 0.0, height);
    let path = [DVec3::ZERO, top * 0.9, top + reach * 0.4, top + reach];
    let head = rounded(at(0.5, 0.2, 0.12), 0.05).moved(top + reach);
    Mesh::joined(&[tube(&path, &[0.08, 0.06, 0.05, 0.05], 8), head]).with(metal).turned(random.range(0.0, 6.3))
}

pub(crate) fn bench(kit: &mut Kit, random: &mut Random) -> Mesh {
    let wood = palette::wood(random, false);
    let wood = kit.slot(wood);
    let metal = kit.slot(palette::metal(random));
    let half = random.range(0.6, 1.0);
    let mut mesh = Mesh::default();
    for k in 0..4 {
        let y = -0.2 + 0.12 * f64::from(k);
        mesh.add(&block(at(-half, y, 0.43), at(half, y + 0.09, 0.46)).with(wood));
        let z = 0.55 + 0.1 * f64::from(k);
        mesh.add(
            &block(at(-half, 0.26 + 0.02 * f64::from(k), z), at(half, 0.29 + 0.02 * f64::from(k), z + 0.07)).with(wood),
        );
    }
    for x in [-half * 0.8, half * 0.8] {
        mesh.add(&block(at(x - 0.03, -0.2, 0.0), at(x + 0.03, -0.15, 0.43)).with(metal));
        mesh.add(&block(at(x - 0.03, 0.25, 0.0), at(x + 0.03, 0.3, 0.9)).with(metal));
        mesh.add(&block(at(x - 0.03, -0.2, 0.4), at(x + 0.03, 0.28, 0.43)).with(metal));
    }
    mesh
}
