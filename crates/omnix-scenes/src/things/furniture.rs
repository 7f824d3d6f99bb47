//! Furniture of rooms, in usual sizes.

use glam::{DQuat, DVec2, DVec3};

use crate::material::Material;
use crate::mesh::Mesh;
use crate::palette;
use crate::random::Random;
use crate::shapes::{blade, block, capsule, cone, cuboid, cylinder, frame, lathe, rounded, sheet, sphere};
use crate::things::{Kit, object};

/// A place on which things can stand.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Top {
    pub(crate) centre: DVec3,
    pub(crate) half: DVec2,
    /// Free height above.
    pub(crate) room: f64,
}

/// A piece of furniture: its back is towards +y.
#[derive(Debug, Default)]
pub(crate) struct Piece {
    pub(crate) mesh: Mesh,
    pub(crate) tops: Vec<Top>,
    /// Half of its width and depth.
    pub(crate) half: DVec2,
}

fn at(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

/// Wood, lacquer or metal.
fn body(kit: &mut Kit, random: &mut Random) -> u16 {
    let material = match random.weighted(&[5.0, 2.0, 2.0, 0.5]) {
        0 => palette::wood(random, false),
        1 => palette::paint(random),
        2 => palette::white(random),
        _ => palette::metal(random),
    };
    kit.slot(material)
}

/// Four legs under the corners of a rectangle.
fn legs(random: &mut Random, half: DVec2, height: f64, inset: f64) -> Mesh {
    let thick = random.range(0.02, 0.045);
    let round = random.chance(0.4);
    let mut mesh = Mesh::default();
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
        let foot = at(x * (half.x - inset), y * (half.y - inset), 0.0);
        let leg = if round {
            cone(thick * 0.7, thick, height, 10)
        } else {
            block(at(-thick, -thick, 0.0), at(thick, thick, height))
        };
        mesh.add(&leg.moved(foot));
    }
    mesh
}

pub(crate) fn table(kit: &mut Kit, random: &mut Random) -> Piece {
    let half = DVec2::new(random.range(0.4, 1.0), random.range(0.35, 0.55));
    let low = random.chance(0.3);
    let height = if low { random.range(0.35, 0.5) } else { random.range(0.68, 0.78) };
    let thick = random.range(0.02, 0.06);
    let (top, leg) = (body(kit, random), body(kit, random));
    let leg = if random.chance(0.6) { top } else { leg };
    let mut mesh = if random.chance(0.2) {
        let round = cylinder(half.y * 1.2, thick, 32).moved(at(0.0, 0.0, height - thick)).with(top);
        let foot = Mesh::joined(&[cylinder(0.05, height - thick, 12), cone(half.y * 0.7, 0.06, 0.06, 20)]).with(leg);
        Mesh::joined(&[round, foot])
    } else {
        let plate =
            rounded(at(half.x * 2.0, half.y * 2.0, thick), 0.008).moved(at(0.0, 0.0, height - thick / 2.0)).settled();
        Mesh::joined(&[plate.with(top), legs(random, half, height - thick, 0.06).with(leg)])
    };
    if random.chance(0.25) {
        let cloth = palette::cloth(random, &kit.photos);
        let cover = block(at(-half.x * 0.6, -half.y - 0.005, height), at(half.x * 0.6, half.y + 0.005, height + 0.006));
        mesh.add(&kit.made(cover, cloth));
    }
    let top = Top { centre: at(0.0, 0.0, height + 0.006), half: half * 0.85, room: 0.6 };
    Piece { mesh, tops: vec![top], half }
}

pub(crate) fn desk(kit: &mut Kit, random: &mut Random) -> Piece {
    let mut piece = table(kit, random);
    let slot = body(kit, random);
    let height = piece.tops[0].centre.z - 0.08;
    let (x, depth) = (piece.half.x - 0.05, piece.half.y - 0.05);
    let side = random.sign();
    let drawers =
        block(at(-0.2, -depth, 0.05), at(0.2, depth, height)).moved(at(side * (x - 0.22), 0.0, 0.0)).settled();
    piece.mesh.add(&drawers.with(slot));
    for k in 0..3 {
        let z = 0.05 + (f64::from(k) + 0.5) * (height - 0.05) / 3.0;
        let front =
            cuboid(at(0.36, 0.015, (height - 0.05) / 3.0 - 0.02)).moved(at(side * (x - 0.22), -depth - 0.006, z));
        piece.mesh.add(&front.with(slot));
        let knob = sphere(0.012, 8, 5).moved(at(side * (x - 0.22), -depth - 0.02, z));
        piece.mesh.add(&knob.with(slot));
    }
    piece
}

pub(crate) fn chair(kit: &mut Kit, random: &mut Random) -> Piece {
    let half = DVec2::new(random.range(0.19, 0.25), random.range(0.19, 0.25));
    let seat = random.range(0.42, 0.48);
    let back = random.range(0.35, 0.55);
    let wood = body(kit, random);
    let pad = if random.chance(0.5) { wood } else { kit.slot(palette::cloth(random, &kit.photos.clone())) };
    let thick = random.range(0.03, 0.08);
    let mut mesh =
        rounded(at(half.x * 2.0, half.y * 2.0, thick), thick * 0.3).moved(at(0.0, 0.0, seat - thick / 2.0)).with(pad);
    if random.chance(0.2) {
        // An office chair on a column with a star of feet.
        mesh.add(&cylinder(0.03, seat - thick, 10).with(wood));
        for k in 0..5 {
            let angle = k as f64 / 5.0 * std::f64::consts::TAU;
            let foot = at(angle.cos(), angle.sin(), 0.0) * 0.28 + at(0.0, 0.0, 0.04);
            mesh.add(&capsule(at(0.0, 0.0, 0.1), foot, 0.025, 0.02, 8).with(wood));
        }
    } else {
        mesh.add(&legs(random, half, seat - thick, 0.03).with(wood));
    }
    let lean = DQuat::from_rotation_x(-random.range(0.05, 0.25));
    let rest = if random.chance(0.5) {
        rounded(at(half.x * 1.9, 0.04, back), 0.015).moved(at(0.0, 0.0, back / 2.0 + 0.03)).with(pad)
    } else {
        let mut bars = Mesh::default();
        for k in 0..=4 {
            let x = (f64::from(k) / 2.0 - 1.0) * half.x * 0.9;
            bars.add(&block(at(x - 0.015, -0.012, -0.02), at(x + 0.015, 0.012, back)));
        }
        bars.add(&block(at(-half.x, -0.018, back - 0.06), at(half.x, 0.018, back)));
        bars.with(wood)
    };
    mesh.add(&rest.rotated(lean).moved(at(0.0, half.y - 0.03, seat)));
    Piece { mesh, tops: vec![Top { centre: at(0.0, 0.0, seat), half: half * 0.5, room: 0.3 }], half }
}

pub(crate) fn shelf(kit: &mut Kit, random: &mut Random) -> Piece {
    let half = DVec2::new(random.range(0.3, 0.8), random.range(0.13, 0.22));
    let height = random.range(0.8, 2.2);
    let levels = (height / random.range(0.28, 0.42)) as usize + 1;
    let slot = body(kit, random);
    let thick = 0.02;
    let mut mesh = Mesh::default();
    for x in [-half.x, half.x] {
        mesh.add(&block(at(x - thick / 2.0, -half.y, 0.0), at(x + thick / 2.0, half.y, height)));
    }
    if random.chance(0.7) {
        mesh.add(&block(at(-half.x, half.y - 0.01, 0.0), at(half.x, half.y, height)));
    }
    let step = height / levels as f64;
    let mut tops = Vec::new();
    for k in 0..=levels {
        let z = 0.04 + (height - 0.05) * k as f64 / levels as f64;
        mesh.add(&block(at(-half.x, -half.y, z - thick / 2.0), at(half.x, half.y, z + thick / 2.0)));
        let room = if k == levels { 0.4 } else { step - 0.04 };
        tops.push(Top { centre: at(0.0, 0.0, z + thick / 2.0), half: half * 0.85, room });
    }
    let mut mesh = mesh.with(slot);
    // Rows of books on some of the boards.
    tops.retain(|top| {
        if top.room < 0.2 || !random.chance(0.45) {
            return true;
        }
        let tall = top.room * random.range(0.65, 0.9);
        let thick = random.range(0.02, 0.05);
        let spines = palette::spines(random, thick);
        let left = -half.x + 0.02 + random.range(0.0, 0.3) * half.x;
        let right = half.x - 0.02 - random.range(0.0, 0.4) * half.x;
        let spines = kit.slot(spines);
        let mut x = left;
        while x < right {
            let wide = random.range(0.06, 0.2).min(right - x);
            let high = tall * random.range(0.8, 1.0);
            let front = -half.y * random.range(0.4, 0.9);
            mesh.add(&block(at(x, front, top.centre.z), at(x + wide, half.y * 0.8, top.centre.z + high)).with(spines));
            x += wide;
        }
        false
    });
    Piece { mesh, tops, half }
}

pub(crate) fn cabinet(kit: &mut Kit, random: &mut Random) -> Piece {
    let half = DVec2::new(random.range(0.3, 0.9), random.range(0.2, 0.3));
    let height = if random.chance(0.3) { random.range(1.6, 2.1) } else { random.range(0.5, 1.0) };
    let (slot, front) = (body(kit, random), body(kit, random));
    let front = if random.chance(0.6) { slot } else { front };
    let knob = kit.slot(palette::metal(random));
    let mut mesh = block(at(-half.x, -half.y, 0.06), at(half.x, half.y, height)).with(slot);
    let columns = ((half.x * 2.0) / random.range(0.35, 0.6)).ceil() as usize;
    let rows = if random.chance(0.5) { 1 } else { (height / 0.25).ceil() as usize };
    let size = DVec2::new(half.x * 2.0 / columns as f64, (height - 0.08) / rows as f64);
    for i in 0..rows {
        for j in 0..columns {
            let (x, z) = (-half.x + (j as f64 + 0.5) * size.x, 0.07 + (i as f64 + 0.5) * size.y);
            let door =
                rounded(at(size.x - 0.012, 0.02, size.y - 0.012), 0.004).moved(at(x, -half.y - 0.008, z)).settled();
            mesh.add(&door.with(front));
            mesh.add(&sphere(0.014, 8, 5).moved(at(x + size.x * 0.35, -half.y - 0.03, z)).with(knob));
        }
    }
    let top = Top { centre: at(0.0, 0.0, height), half: half * 0.85, room: 0.5 };
    Piece { mesh, tops: vec![top], half }
}

pub(crate) fn sofa(kit: &mut Kit, random: &mut Random) -> Piece {
    let seats = random.count(1, 3);
    let width = random.range(0.6, 0.75);
    let half = DVec2::new(width * seats as f64 / 2.0 + 0.15, random.range(0.38, 0.48));
    let slot = kit.slot(palette::cloth(random, &kit.photos.clone()));
    let (seat, back) = (random.range(0.38, 0.46), random.range(0.7, 0.95));
    let soft = random.range(0.03, 0.09);
    let mut mesh = rounded(at(half.x * 2.0, half.y * 2.0, 0.26), soft * 0.5).moved(at(0.0, 0.0, 0.2));
    mesh.add(&rounded(at(half.x * 2.0, 0.2, back - 0.08), soft).moved(at(0.0, half.y - 0.1, (back + 0.08) / 2.0)));
    for side in [-1.0, 1.0] {
        let arm = rounded(at(0.16, half.y * 2.0, seat + 0.12), soft).moved(at(
            side * (half.x - 0.08),
            0.0,
            (seat + 0.2) / 2.0,
        ));
        mesh.add(&arm);
    }
    for k in 0..seats {
        let x = (k as f64 - (seats - 1) as f64 / 2.0) * width;
        mesh.add(&rounded(at(width - 0.02, half.y * 2.0 - 0.2, 0.16), soft).moved(at(x, -0.1, seat - 0.06)));
        mesh.add(&rounded(at(width - 0.03, 0.16, back - seat + 0.02), soft).moved(at(
            x,
            half.y - 0.25,
            (back + seat) / 2.0,
        )));
    }
    let mut mesh = mesh.settled().with(slot);
    for _ in 0..random.below(3) {
        let pillow = kit.slot(palette::cloth(random, &kit.photos.clone()));
        let size = random.range(0.3, 0.45);
        let x = random.range(-half.x + 0.3, half.x - 0.3);
        let shape = crate::shapes::superquadric(at(size / 2.0, 0.08, size / 2.0), [0.7, 0.5], 16, 8);
        let turn = DQuat::from_rotation_x(-0.4) * DQuat::from_rotation_y(random.range(-0.6, 0.6));
        mesh.add(&shape.rotated(turn).moved(at(x, half.y - 0.42, seat + size * 0.45)).with(pillow));
    }
    Piece { mesh, tops: Vec::new(), half }
}

pub(crate) fn bed(kit: &mut Kit, random: &mut Random) -> Piece {
    let half = DVec2::new(random.range(0.45, 0.9), random.range(0.95, 1.05));
    let wood = body(kit, random);
    let sheets = kit.slot(palette::cloth(random, &kit.photos.clone()));
    let white = kit.slot(palette::white(random));
    let height = random.range(0.4, 0.6);
    let seed = random.bits() as u32;
    let mut mesh = block(at(-half.x, -half.y, 0.12), at(half.x, half.y, height - 0.2)).with(wood);
    mesh.add(&block(at(-half.x, half.y, 0.0), at(half.x, half.y + 0.05, height + random.range(0.2, 0.6))).with(wood));
    mesh.add(
        &rounded(at(half.x * 2.0 - 0.02, half.y * 2.0 - 0.02, 0.22), 0.06)
            .moved(at(0.0, 0.0, height - 0.1))
            .with(white),
    );
    let cover = sheet(DVec2::new(half.x * 2.1, half.y * 1.4), [24, 24], |p| {
        let over = (p.x.abs() - half.x + 0.03).max(0.0);
        let folds = f64::from(crate::noise::fractal(p.extend(0.0).as_vec3() * 3.0, 3, 0.0, seed)) * 0.1;
        at(p.x - over * p.x.signum() * 0.5, p.y - half.y * 0.3, height + 0.005 + folds - over * 3.0)
    });
    mesh.add(&cover.with(sheets));
    let pillow = crate::shapes::superquadric(at(half.x * 0.45, 0.2, 0.09), [0.5, 0.6], 18, 8);
    for side in if half.x > 0.6 { vec![-0.5, 0.5] } else { vec![0.0] } {
        mesh.add(&pillow.clone().moved(at(side * half.x, half.y - 0.28, height + 0.07)).with(white));
    }
    Piece { mesh, tops: Vec::new(), half: half + 0.05 }
}

/// A floor lamp, unlit or lit; and the place of its light.
pub(crate) fn lamp(kit: &mut Kit, random: &mut Random) -> (Piece, DVec3) {
    let height = random.range(1.2, 1.7);
    let metal = kit.slot(palette::metal(random));
    let shade = kit.slot(Material { glow: 0.8, ..palette::white(random) });
    let (low, high) = (random.range(0.15, 0.25), random.range(0.08, 0.2));
    let tall = random.range(0.2, 0.3);
    let p = |r: f64, z: f64| DVec2::new(r, z);
    let mesh = Mesh::joined(&[
        cylinder(0.14, 0.02, 20).with(metal),
        cylinder(0.012, height, 8).with(metal),
        lathe(&[p(low, 0.0), p(high, tall)], 20).moved(at(0.0, 0.0, height)).with(shade),
    ]);
    (Piece { mesh, tops: Vec::new(), half: DVec2::splat(low) }, at(0.0, 0.0, height + tall + 0.1))
}

/// A plant in a pot.
pub(crate) fn plant(kit: &mut Kit, random: &mut Random, height: f64) -> Mesh {
    let pot = random.range(0.12, 0.2) * height.min(1.0);
    let clay = palette::any(random, &kit.photos);
    let p = |r: f64, z: f64| DVec2::new(r, z);
    let wall = [
        p(0.0, 0.0),
        p(pot * 0.7, 0.0),
        p(pot * 0.7, 0.0),
        p(pot, pot * 1.6),
        p(pot * 0.9, pot * 1.6),
        p(0.0, pot * 1.4),
    ];
    let mut mesh = kit.made(lathe(&wall, 20), clay);
    let green = kit.slot(palette::leaves(random));
    let (count, droop, wide) = (random.count(12, 45), random.range(0.1, 0.7), random.range(0.03, 0.14));
    let spread = random.range(0.3, 1.2);
    for _ in 0..count {
        let side = random.direction();
        let tip = at(side.x * spread, side.y * spread, random.range(0.5, 1.2)).normalize();
        let length = (height - pot) * random.range(0.4, 1.0);
        let root = at(side.x, side.y, 0.0) * pot * 0.3 + at(0.0, 0.0, pot * 1.4);
        mesh.add(&blade(tip * length, length * wide, droop, 5).moved(root).with(green));
    }
    mesh
}

/// A framed picture in the xz plane that looks towards -y, centred at the origin.
pub(crate) fn picture(kit: &mut Kit, random: &mut Random) -> Mesh {
    let (w, h) = (random.range(0.25, 1.1), random.range(0.25, 0.9));
    let bar = random.range(0.012, 0.06);
    let wood = body(kit, random);
    let print = palette::poster(random, &kit.photos, w, h);
    let mut mesh = frame(w, h, bar, 0.03).with(wood);
    mesh.add(&kit.made(cuboid(at(w - bar, 0.012, h - bar)), print));
    mesh
}

pub(crate) fn rug(kit: &mut Kit, random: &mut Random) -> Piece {
    let half = DVec2::new(random.range(0.5, 1.6), random.range(0.4, 1.2));
    let cloth = palette::cloth(random, &kit.photos);
    let border = palette::cloth(random, &kit.photos);
    let thick = random.range(0.006, 0.015);
    let mut mesh = kit.made(block(at(-half.x, -half.y, 0.0), at(half.x, half.y, thick)), border);
    let inner = half * random.range(0.8, 0.95);
    mesh.add(&kit.made(block(at(-inner.x, -inner.y, thick), at(inner.x, inner.y, thick + 0.002)), cloth));
    Piece { mesh, tops: Vec::new(), half }
}

/// A curtain in the xz plane, hanging down from the origin.
pub(crate) fn curtain(kit: &mut Kit, random: &mut Random, width: f64, height: f64) -> Mesh {
    let cloth = palette::cloth(random, &kit.photos);
    let (folds, deep) = (width * random.range(6.0, 12.0), random.range(0.02, 0.05));
    let hanging = sheet(DVec2::new(width, height), [(folds * 4.0) as usize + 4, 4], |p| {
        let wave = (p.x / width * folds * std::f64::consts::TAU).sin();
        at(p.x, wave * deep * (0.7 + 0.3 * p.y / height), p.y - height / 2.0)
    });
    kit.made(hanging, cloth)
}

impl Piece {
    /// Puts things on the piece's free places.
    pub(crate) fn filled(mut self, kit: &mut Kit, random: &mut Random, density: f64) -> Self {
        for top in &self.tops {
            let area = top.half.x * top.half.y * 4.0;
            let count = (area * density * random.range(0.3, 1.7) + random.unit()) as usize;
            for _ in 0..count.min(14) {
                let size = random.log_range(0.07, 0.32).min(top.room * 0.8).min(top.half.min_element() * 1.6);
                let place = random.inside(-top.half, top.half);
                let thing = object(kit, random, size).turned(random.range(0.0, 6.3));
                self.mesh.add(&thing.moved(top.centre + place.extend(0.0)));
            }
        }
        self
    }
}
