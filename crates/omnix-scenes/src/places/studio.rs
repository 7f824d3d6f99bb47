//! Shapes of all kinds and materials before a backdrop, standing, piled and floating, at any scale.

use glam::{DQuat, DVec2, DVec3, Vec3};

use crate::light::{Lamp, Sky};
use crate::mesh::Mesh;
use crate::palette;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::shapes::{cuboid, sheet};
use crate::stage::{Spot, Stage, daylight};
use crate::things::{Arena, object};

/// Things about the origin, the floor at z = 0.
pub(crate) fn studio(stage: &mut Stage, random: &Random, recipe: &Recipe) {
    let mut own = random.fork("studio");
    // Half of the stage's width in metres.
    let half = own.log_range(0.4, 5.0);
    backdrop(stage, &mut own, half);
    let count = own.count(6, 34);
    for k in 0..count {
        let mut own = own.at(k);
        let place = own.inside(DVec2::splat(-half), DVec2::splat(half));
        let size = half * own.log_range(0.1, 0.7);
        // The middle stays free for what moves.
        if place.length() < half * 0.35 && own.chance(0.7) {
            continue;
        }
        let mut thing = object(&mut stage.kit, &mut own, size).turned(own.range(0.0, 6.3));
        if own.chance(0.3) {
            let up = own.range(0.2, 1.3) * half;
            thing = thing.rotated(own.rotation()).moved(DVec3::Z * up);
        }
        stage.still.add(&thing.moved(place.extend(0.0)));
    }
    let arena = Arena {
        low: DVec2::splat(-half * 0.7),
        high: DVec2::splat(half * 0.7),
        floor: 0.0,
        tall: half * 1.2,
        seconds: stage.seconds,
        speed: recipe.speed,
        people: half > 2.0,
    };
    stage.movers(random, recipe, &arena);
    stage.spots.push(Spot {
        focus: DVec3::Z * half * own.range(0.15, 0.45),
        spread: DVec3::new(0.4, 0.4, 0.15) * half,
        distance: [half * 0.7, half * 2.2],
        height: [half * 0.15, half * 1.5],
        uneven: false,
        inside: [DVec3::new(-2.3, -2.3, 0.08) * half, DVec3::new(2.3, 2.3, 2.4) * half],
    });
}

/// Floor and walls, a sweep of paper, or an open floor under the sky; and the light of each.
fn backdrop(stage: &mut Stage, random: &mut Random, half: f64) {
    let photos = stage.kit.photos.clone();
    let size = half * 2.6;
    // Patterns are as large as the stage asks for.
    let scaled = |mut material: crate::material::Material, random: &mut Random| {
        material.scale *= (half * random.range(0.3, 1.0)) as f32;
        material
    };
    let ground = palette::any(random, &photos);
    let ground = scaled(ground, random);
    let mut floor = Mesh::default();
    let closed = random.chance(0.65);
    let reach = if closed { size } else { size * 20.0 };
    let (x, y) = (DVec3::X * reach, DVec3::Y * reach);
    floor.face([-x - y, x - y, x + y, -x + y]);
    stage.still.add(&stage.kit.made(floor, ground));
    if closed {
        let sweep = random.chance(0.3);
        for quarter in 0..4 {
            let paper = if random.chance(0.5) { palette::any(random, &photos) } else { palette::wall(random, &photos) };
            let paper = scaled(paper, random);
            let wall = if sweep {
                let bend = size * 0.4;
                sheet(DVec2::new(size * 2.0, size * 2.4), [2, 24], move |p| {
                    let s = (p.y / (size * 2.4) + 0.5) * (size * 2.4);
                    let angle = (s / bend).min(std::f64::consts::FRAC_PI_2);
                    let rest = (s - bend * std::f64::consts::FRAC_PI_2).max(0.0);
                    DVec3::new(p.x, size - bend + bend * angle.sin(), bend * (1.0 - angle.cos()) + rest)
                })
            } else {
                cuboid(DVec3::new(size * 2.0, 0.02 * size, size * 2.0)).moved(DVec3::new(0.0, size, size)).settled()
            };
            stage.still.add(&stage.kit.made(wall, paper).turned(f64::from(quarter) * std::f64::consts::FRAC_PI_2));
        }
        let tint = palette::hsv(random.unit(), random.range(0.0, 0.2), 0.9);
        stage.light.sky = Sky::even(tint * random.range(0.2, 0.9) as f32);
        for _ in 0..random.count(1, 3) {
            let centre = DVec3::new(random.range(-0.9, 0.9), random.range(-0.9, 0.9), random.range(1.0, 1.8)) * size;
            let area = half * random.range(0.2, 1.5);
            let turn = DQuat::from_rotation_arc(DVec3::Z, (-centre).normalize_or(DVec3::NEG_Z));
            let edges = [turn * DVec3::X * area, turn * DVec3::Y * area];
            let warm = Vec3::new(1.0, random.range(0.75, 1.0) as f32, random.range(0.6, 1.1) as f32);
            let strength = (size * size / (area * area)) as f32 * random.range(1.0, 5.0) as f32;
            stage.light.lamps.push(Lamp::Panel {
                corner: centre - (edges[0] + edges[1]) / 2.0,
                edges,
                colour: warm * strength,
            });
        }
        stage.light.fill = tint * random.range(0.1, 0.4) as f32;
    } else {
        let (sky, sun) = daylight(random);
        stage.light.fill = (sky.zenith + sky.horizon) * 0.12;
        stage.light.lamps.extend(sun);
        stage.light.sky = sky;
    }
}
