//! Furnished rooms, and a table in a room from near.
//!
//! The floor is z = 0 from (0, 0) to (width, depth). Windows are openings to a sky and a ground outside, and lamps at once: panels of
//! the sky's mean colour, since few random rays would find them.

use glam::{DVec2, DVec3, Vec3};

use super::walls::{Room, Wall, panelled};
use crate::light::Lamp;
use crate::mesh::Mesh;
use crate::palette;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::shapes::{block, cuboid, cylinder, frame, sphere};
use crate::stage::{Spot, Stage, daylight};
use crate::things::{
    Arena, Piece, bed, cabinet, chair, curtain, desk as desk_piece, hanging, house, lamp, object, picture, piece,
    plant, rug, shelf, sofa, table, tree,
};

/// A room with furniture, people and things.
pub(crate) fn room(stage: &mut Stage, random: &Random, recipe: &Recipe) {
    let mut own = random.fork("room");
    let room = Room { width: own.range(2.6, 7.0), depth: own.range(2.6, 6.0), height: own.range(2.3, 3.1) };
    shell(stage, &mut random.fork("shell"), &room);
    furnish(stage, &mut random.fork("furniture"), recipe, &room);
    let margin = DVec2::splat(0.7);
    let arena = Arena {
        low: margin,
        high: DVec2::new(room.width, room.depth) - margin,
        floor: 0.0,
        tall: room.height * 0.8,
        seconds: stage.seconds,
        speed: recipe.speed,
        people: true,
    };
    stage.movers(random, recipe, &arena);
    let middle = DVec3::new(room.width / 2.0, room.depth / 2.0, own.range(0.5, 1.1));
    let reach = room.width.hypot(room.depth) * 0.5;
    stage.spots.push(Spot {
        focus: middle,
        spread: DVec3::new(room.width * 0.22, room.depth * 0.22, 0.35),
        distance: [reach * 0.35, reach],
        height: [0.7, (room.height - 0.4).min(2.0)],
        uneven: false,
        inside: [DVec3::new(0.2, 0.2, 0.25), DVec3::new(room.width - 0.2, room.depth - 0.2, room.height - 0.2)],
    });
}

/// A table with many things, from near.
pub(crate) fn desk(stage: &mut Stage, random: &Random, recipe: &Recipe) {
    let mut own = random.fork("desk");
    let room = Room { width: own.range(2.6, 5.0), depth: own.range(2.6, 5.0), height: own.range(2.3, 2.9) };
    shell(stage, &mut random.fork("shell"), &room);
    let piece = if own.chance(0.5) { table(&mut stage.kit, &mut own) } else { desk_piece(&mut stage.kit, &mut own) };
    let piece = piece.filled(&mut stage.kit, &mut own, recipe.clutter * 1.3);
    let (top, half) = (piece.tops[0], piece.half);
    // In the middle, or against a wall.
    let place = if own.chance(0.5) {
        DVec2::new(room.width, room.depth) / 2.0
    } else {
        DVec2::new(room.width / 2.0, room.depth - half.y - 0.02)
    };
    stage.take(place, half.length() + 0.1);
    stage.still.add(&piece.mesh.moved(place.extend(0.0)));
    furnish(stage, &mut random.fork("furniture"), recipe, &room);
    let centre = top.centre + place.extend(0.0);
    let flat = centre.truncate();
    let arena = Arena {
        low: flat - top.half,
        high: flat + top.half,
        floor: centre.z,
        tall: 0.6,
        seconds: stage.seconds,
        speed: recipe.speed,
        people: false,
    };
    stage.movers(random, recipe, &arena);
    stage.spots.push(Spot {
        focus: centre + DVec3::Z * 0.08,
        spread: (top.half * 0.5).extend(0.06),
        distance: [0.25, 1.3],
        height: [centre.z + 0.15, centre.z + 0.9],
        uneven: false,
        inside: [DVec3::new(0.15, 0.15, 0.3), DVec3::new(room.width - 0.15, room.depth - 0.15, room.height - 0.15)],
    });
}

/// Floor, ceiling, walls with windows and a door, pictures, lamps, and what is outside.
fn shell(stage: &mut Stage, random: &mut Random, room: &Room) {
    let (w, d, h) = (room.width, room.depth, room.height);
    let photos = stage.kit.photos.clone();
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let mut ground = Mesh::default();
    ground.face([at(0.0, 0.0, 0.0), at(w, 0.0, 0.0), at(w, d, 0.0), at(0.0, d, 0.0)]);
    let floor = palette::floor(random, &photos);
    stage.still.add(&stage.kit.made(ground, floor));
    let mut ceiling = Mesh::default();
    ceiling.face([at(0.0, 0.0, h), at(0.0, d, h), at(w, d, h), at(w, 0.0, h)]);
    let ceiling_paint = if random.chance(0.85) { palette::white(random) } else { palette::wood(random, true) };
    stage.still.add(&stage.kit.made(ceiling, ceiling_paint));

    let (sky, sun) = daylight(random);
    let outside = (sky.zenith + sky.horizon + sky.ground) * 0.4;
    let day = random.chance(0.85);
    let mut light = 0.0_f32;
    let paper = palette::wall(random, &photos);
    let paper = stage.kit.slot(paper);
    let feature = if random.chance(0.3) { stage.kit.slot(palette::wall(random, &photos)) } else { paper };
    let trim = stage.kit.slot(palette::white(random));
    let count = random.count(1, 4);
    let first = random.below(4);
    let drapes = random.chance(0.4);
    for (k, wall) in room.walls().into_iter().enumerate() {
        let slot = if k == first { feature } else { paper };
        let mut holes = Vec::new();
        if (k + first) % 4 < count.div_ceil(2) && day {
            let panes = if wall.length > 3.5 && random.chance(0.5) { 2 } else { 1 };
            let wide = random.range(0.7, 1.5).min(wall.length / panes as f64 - 0.5);
            let (low, high) = (random.range(0.3, 1.0), (h - random.range(0.15, 0.5)).min(2.3));
            for pane in 0..panes {
                let middle = wall.length * (pane as f64 + 0.5) / panes as f64;
                holes.push([middle - wide / 2.0, middle + wide / 2.0, low, high]);
            }
        }
        stage.still.add(&panelled(&wall, &holes, h).with(slot));
        let board = block(at(0.0, 0.0, 0.0), at(wall.length, 0.012, 0.08)).with(trim);
        let angle = wall.along.y.atan2(wall.along.x);
        stage.still.add(&board.turned(angle).moved(wall.from));
        for &[a, b, low, high] in &holes {
            let (middle, size) = ((a + b) / 2.0, DVec2::new(b - a, high - low));
            let mut window = frame(size.x, size.y, 0.05, 0.05);
            if random.chance(0.7) {
                window.add(&cuboid(at(0.04, 0.04, size.y)));
            }
            let window = window.with(trim);
            stage.still.add(&wall.against(window, middle, -0.08, (low + high) / 2.0));
            let sill = block(at(-size.x / 2.0 - 0.05, -0.1, -0.03), at(size.x / 2.0 + 0.05, 0.0, 0.0)).with(trim);
            stage.still.add(&wall.against(sill, middle, 0.0, low));
            if drapes {
                let narrow = size.x * random.range(0.15, 0.45);
                for side in [-1.0, 1.0] {
                    let cloth = curtain(&mut stage.kit, random, narrow, high - low + 0.3);
                    stage.still.add(&wall.against(cloth, middle + side * (size.x / 2.0), 0.07, high + 0.1));
                }
            }
            let corner = wall.from + wall.along * a + DVec3::Z * low - wall.inward() * 0.02;
            let strength = random.range(2.0, 5.0) as f32;
            // The panel's normal looks into the room.
            let edges = [DVec3::Z * size.y, wall.along * size.x];
            let edges = if edges[0].cross(edges[1]).dot(wall.inward()) > 0.0 { edges } else { [edges[1], edges[0]] };
            stage.light.lamps.push(Lamp::Panel { corner, edges, colour: outside * strength });
            light += (size.x * size.y) as f32 * strength * 0.5;
        }
        if holes.is_empty() {
            decorate(stage, random, room, &wall, trim);
        }
    }
    if day && let Some(sun) = sun {
        stage.light.lamps.push(sun);
    }
    // A lamp on the ceiling; without daylight always.
    if !day || random.chance(0.45) {
        let warm = Vec3::new(1.0, random.range(0.75, 0.97) as f32, random.range(0.5, 0.95) as f32);
        let power = random.range(0.5, 2.5) as f32;
        let lamps = if w * d > 14.0 && random.chance(0.5) { 2 } else { 1 };
        for k in 0..lamps {
            let centre =
                at(w * (k as f64 + 0.5) / lamps as f64, d * random.range(0.35, 0.65), h - random.range(0.08, 0.5));
            let glow = stage.kit.slot(palette::glowing(warm, 3.0));
            let metal = stage.kit.slot(palette::metal(random));
            let radius = random.range(0.08, 0.16);
            stage.still.add(&sphere(radius, 16, 8).moved(centre).with(glow));
            stage.still.add(&cylinder(0.012, h - centre.z, 6).moved(centre).with(metal));
            stage.light.lamps.push(Lamp::Bulb { centre, radius, colour: warm * power });
            light += power * 9.0;
        }
    }
    // What is reflected more than once, spread over all surfaces.
    let mean = light / room.area() as f32;
    stage.light.fill = Vec3::new(1.0, 0.96, 0.9) * mean * random.range(0.5, 1.0) as f32;
    stage.light.sky = sky;
    stage.light.closed = Some([at(0.0, 0.0, 0.0), at(w, d, h)]);
    outside_view(stage, random, room);
}

/// A door, pictures, hanging shelves.
fn decorate(stage: &mut Stage, random: &mut Random, room: &Room, wall: &Wall, trim: u16) {
    let has_door = random.chance(0.4);
    if has_door {
        let door = match random.below(3) {
            0 => palette::white(random),
            1 => palette::wood(random, false),
            _ => palette::paint(random),
        };
        let leaf = stage.kit.made(cuboid(DVec3::new(0.85, 0.04, 2.0)), door);
        let metal = stage.kit.slot(palette::metal(random));
        let place = random.range(0.6, (wall.length - 0.6).max(0.7));
        stage.still.add(&wall.against(leaf, place, 0.0, 1.0));
        stage.still.add(&wall.against(frame(1.0, 2.08, 0.08, 0.06).with(trim), place, 0.0, 1.02));
        stage.still.add(&wall.against(sphere(0.03, 10, 6).with(metal), place + 0.33, 0.06, 1.0));
    }
    // What hangs on a wall starts at the left of its free part and leaves its own width.
    let mut right = 0.1;
    for _ in 0..if has_door { 0 } else { 2 } {
        let Some((mesh, size, z)) = hanging(&mut stage.kit, random, false) else { break };
        right += random.range(0.0, 0.8);
        if right + size.x < wall.length - 0.1 && z + size.z < room.height {
            stage.still.add(&wall.against(mesh, right + size.x / 2.0, 0.002, z));
            right += size.x;
        }
    }
    for _ in 0..random.below(4) {
        let mesh = picture(&mut stage.kit, random);
        let last = (wall.length - 0.4).max(0.5);
        let place = random.range((right + 0.3).max(0.4).min(last), last);
        let z = random.range(1.2, room.height - 0.7);
        stage.still.add(&wall.against(mesh, place, 0.015, z));
    }
}

/// Ground, a house and trees beyond the windows.
fn outside_view(stage: &mut Stage, random: &mut Random, room: &Room) {
    let below = -random.range(0.2, 6.0);
    let middle = DVec3::new(room.width / 2.0, room.depth / 2.0, below);
    let mut ground = Mesh::default();
    let (x, y) = (DVec3::X * 60.0, DVec3::Y * 60.0);
    ground.face([-x - y, x - y, x + y, -x + y]);
    let earth = palette::ground(random);
    stage.still.add(&stage.kit.made(ground, earth).moved(middle));
    for quarter in 0..4 {
        let turn = f64::from(quarter) * std::f64::consts::FRAC_PI_2;
        let away = random.range(9.0, 20.0);
        let thing = if random.chance(0.5) {
            house(&mut stage.kit, random, 14.0).moved(DVec3::new(-7.0, away, 0.0))
        } else {
            let tall = random.range(4.0, 8.0);
            tree(&mut stage.kit, random, tall).moved(DVec3::new(random.range(-3.0, 3.0), away * 0.7, 0.0))
        };
        stage.still.add(&thing.turned(turn).moved(middle));
    }
}

/// Pieces along the walls, some in the middle, things on the floor.
fn furnish(stage: &mut Stage, random: &mut Random, recipe: &Recipe, room: &Room) {
    let crowd = random.range(0.5, 1.2);
    for wall in room.walls() {
        let mut place = random.range(0.1, 0.6);
        for _ in 0..6 {
            let most = DVec3::new(wall.length - 0.1 - place, room.width.min(room.depth) * 0.45, room.height - 0.05);
            let piece = piece(&mut stage.kit, random, 0.6, most).unwrap_or_else(|| along_wall(stage, random)).filled(
                &mut stage.kit,
                random,
                recipe.clutter,
            );
            let half = piece.half;
            if place + half.x * 2.0 > wall.length - 0.1 {
                break;
            }
            let middle = place + half.x;
            let away = half.y + 0.03;
            let centre = wall.from + wall.along * middle + wall.inward() * away;
            place += half.x * 2.0 + random.range(0.05, 0.9) / crowd;
            if random.chance(0.85) && stage.take(centre.truncate(), half.max_element().min(half.min_element() * 1.5)) {
                stage.still.add(&wall.against(piece.mesh, middle, away, 0.0));
            }
        }
    }
    let (w, d) = (room.width, room.depth);
    let middle = DVec2::new(w, d) / 2.0;
    if random.chance(0.5) {
        let rug = rug(&mut stage.kit, random);
        stage.still.add(&rug.mesh.turned(random.range(-0.3, 0.3)).moved(middle.extend(0.0)));
    }
    if let Some((mesh, size, _)) = hanging(&mut stage.kit, random, true) {
        stage.still.add(&mesh.moved(middle.extend(room.height - size.z)));
    }
    // Models that are left stand about, in front of what stands at the walls.
    for _ in 0..stage.kit.left.min(6) {
        let most = DVec3::new(w * 0.4, d * 0.4, room.height - 0.3);
        let Some(piece) = piece(&mut stage.kit, random, 0.5, most) else { continue };
        let radius = piece.half.length();
        let edge = DVec2::splat(radius + 0.05);
        let centre = random.inside(edge, (DVec2::new(w, d) - edge).max(edge));
        if stage.take(centre, radius * 0.9) {
            let piece = piece.filled(&mut stage.kit, random, recipe.clutter);
            stage.still.add(&piece.mesh.turned(random.range(0.0, 6.3)).moved(centre.extend(0.0)));
        }
    }
    if random.chance(0.55) {
        let piece = table(&mut stage.kit, random).filled(&mut stage.kit, random, recipe.clutter);
        let centre = middle + random.inside(DVec2::new(-0.2 * w, -0.2 * d), DVec2::new(0.2 * w, 0.2 * d));
        let turn = random.range(-0.4, 0.4);
        if stage.take(centre, piece.half.length() * 0.9) {
            for _ in 0..random.below(5) {
                let seat = chair(&mut stage.kit, random);
                let angle = random.range(0.0, std::f64::consts::TAU);
                let out = DVec2::from_angle(angle);
                let reach = (piece.half * out.abs()).length() + 0.3;
                let place = centre + out * reach;
                if place.cmpgt(DVec2::splat(0.3)).all() && place.cmplt(DVec2::new(w, d) - 0.3).all() {
                    let facing = seat.mesh.turned(angle - std::f64::consts::FRAC_PI_2 + random.range(-0.4, 0.4));
                    stage.still.add(&facing.moved(place.extend(0.0)));
                }
            }
            stage.still.add(&piece.mesh.turned(turn).moved(centre.extend(0.0)));
        }
    }
    for _ in 0..random.below(7) {
        let place = random.inside(DVec2::splat(0.3), DVec2::new(w, d) - 0.3);
        let size = random.log_range(0.12, 0.5);
        if stage.take(place, size * 0.5) {
            let thing = object(&mut stage.kit, random, size);
            stage.still.add(&thing.turned(random.range(0.0, 6.3)).moved(place.extend(0.0)));
        }
    }
}

fn along_wall(stage: &mut Stage, random: &mut Random) -> Piece {
    let kit = &mut stage.kit;
    match random.weighted(&[1.6, 1.6, 1.2, 1.0, 0.7, 1.0, 0.8, 0.6, 0.5]) {
        0 => shelf(kit, random),
        1 => cabinet(kit, random),
        2 => sofa(kit, random),
        3 => desk_piece(kit, random),
        4 => bed(kit, random),
        5 => chair(kit, random),
        6 => {
            let height = random.range(0.5, 1.7);
            Piece { mesh: plant(kit, random, height), tops: Vec::new(), half: DVec2::splat(0.25) }
        }
        7 => table(kit, random),
        _ => lamp(kit, random).0,
    }
}
