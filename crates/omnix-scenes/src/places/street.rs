//! A street: a road between pavements, houses on both sides, cars, people, trees.
//!
//! The road runs along x in the middle of y = 0.

use glam::{DQuat, DVec2, DVec3};
use std::sync::Arc;

use crate::actor::Actor;
use crate::cast::Solid;
use crate::mesh::Mesh;
use crate::motion::{Clock, Motion, Track, Turn};
use crate::palette;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::shapes::block;
use crate::stage::{Spot, Stage, daylight};
use crate::things::{Arena, bench, bush, car, house, lamp_post, object, tree, walker};

/// A part of a street with its traffic.
pub(crate) fn street(stage: &mut Stage, random: &Random, recipe: &Recipe) {
    let mut own = random.fork("street");
    let (road, walk) = (own.range(2.8, 4.5), own.range(1.5, 4.5));
    let long = 45.0;
    ground(stage, &mut own, road, walk, long);
    let edge = road + walk;
    for side in [-1.0, 1.0] {
        let mut x = -long;
        while x < long {
            let width = own.range(6.0, 15.0);
            let back = own.range(0.0, 2.0);
            let middle = x + width / 2.0;
            if own.chance(0.88) {
                let front = house(&mut stage.kit, &mut own, width);
                // A house looks towards -y from (0, 0) on: turned for the other side of the street.
                let place =
                    if side > 0.0 { DVec3::new(x, edge + back, 0.0) } else { DVec3::new(x + width, -edge - back, 0.0) };
                let turn = if side > 0.0 { 0.0 } else { std::f64::consts::PI };
                stage.still.add(&front.turned(turn).moved(place));
            } else {
                for _ in 0..3 {
                    let tall = own.range(4.0, 9.0);
                    let place = DVec3::new(middle + own.range(-3.0, 3.0), side * (edge + own.range(2.0, 8.0)), 0.0);
                    stage.still.add(&tree(&mut stage.kit, &mut own, tall).moved(place));
                }
            }
            x += width + if own.chance(0.3) { own.range(1.0, 5.0) } else { 0.0 };
        }
        roadside(stage, &mut own, side, road, walk);
    }
    let (sky, sun) = daylight(&mut own);
    stage.light.fill = (sky.zenith + sky.horizon) * 0.12;
    stage.light.lamps.extend(sun);
    if own.chance(0.3) {
        stage.light.fog = Some((sky.horizon, own.log_range(0.002, 0.03) as f32));
    }
    stage.light.sky = sky;
    let moving = !random.fork("still").chance(recipe.still);
    if moving {
        traffic(stage, &mut random.fork("traffic"), road, walk);
    }
    let arena = Arena {
        low: DVec2::new(-7.0, -edge + 0.6),
        high: DVec2::new(7.0, edge - 0.6),
        floor: 0.0,
        tall: 3.0,
        seconds: stage.seconds,
        speed: recipe.speed.map(|speed| speed * 0.5),
        people: true,
    };
    if moving && own.chance(0.7) {
        stage.movers(random, &Recipe { still: 0.0, ..recipe.clone() }, &arena);
    }
    stage.spots.push(Spot {
        focus: DVec3::new(0.0, own.range(-edge * 0.5, edge * 0.5), own.range(0.8, 1.8)),
        spread: DVec3::new(4.0, edge * 0.4, 0.7),
        distance: [3.0, 14.0],
        height: [1.0, 3.2],
        uneven: false,
        inside: [DVec3::new(-30.0, -edge + 0.4, 0.4), DVec3::new(30.0, edge - 0.4, 8.0)],
    });
}

fn ground(stage: &mut Stage, random: &mut Random, road: f64, walk: f64, long: f64) {
    let at = |x: f64, y: f64, z: f64| DVec3::new(x, y, z);
    let kit = &mut stage.kit;
    let asphalt = palette::pavement(random);
    stage.still.add(&kit.made(block(at(-long, -road, -1.0), at(long, road, 0.0)), asphalt));
    let paving = palette::pavement(random);
    let paving = kit.slot(paving);
    let kerb = kit.slot(palette::white(random));
    for side in [-1.0, 1.0] {
        let (a, b) = (side * road, side * (road + walk + 30.0));
        stage.still.add(&block(at(-long, a.min(b), -1.0), at(long, a.max(b), 0.12)).with(paving));
        let edge = side * road;
        stage.still.add(&block(at(-long, edge - 0.1, -1.0), at(long, edge + 0.1, 0.13)).with(kerb));
    }
    let paint = kit.slot(palette::white(random));
    let step = random.range(3.0, 6.0);
    let count = (2.0 * long / step) as usize;
    for k in 0..count {
        let x = -long + k as f64 * step;
        stage.still.add(&block(at(x, -0.07, 0.0), at(x + step * 0.5, 0.07, 0.004)).with(paint));
    }
    let earth = palette::ground(random);
    let mut plain = Mesh::default();
    let (x, y) = (DVec3::X * 400.0, DVec3::Y * 400.0);
    plain.face([-x - y, x - y, x + y, -x + y]);
    stage.still.add(&kit.made(plain, earth).moved(at(0.0, 0.0, -0.4)));
}

/// Parked cars, trees, lamps, benches, bins.
fn roadside(stage: &mut Stage, random: &mut Random, side: f64, road: f64, walk: f64) {
    let mut x = -30.0;
    let parked = random.chance(0.6);
    while x < 30.0 {
        x += random.range(4.8, 9.0);
        if parked && random.chance(0.6) {
            let mesh = car(&mut stage.kit, random).turned(if random.chance(0.5) { 0.0 } else { std::f64::consts::PI });
            stage.still.add(&mesh.moved(DVec3::new(x, side * (road - 1.0), 0.0)));
        }
        let kerb = DVec3::new(x + 2.0, side * (road + 0.5), 0.12);
        let wall = DVec3::new(x + random.range(-2.0, 2.0), side * (road + walk - 0.5), 0.12);
        let mesh = match random.below(7) {
            0 => {
                let tall = random.range(3.5, 7.5);
                tree(&mut stage.kit, random, tall).moved(kerb)
            }
            1 => lamp_post(&mut stage.kit, random).moved(kerb),
            2 => bench(&mut stage.kit, random).turned(if side > 0.0 { 0.0 } else { std::f64::consts::PI }).moved(wall),
            3 => {
                let size = random.range(0.6, 1.4);
                bush(&mut stage.kit, random, size).moved(wall)
            }
            4 => {
                let size = random.range(0.5, 1.2);
                object(&mut stage.kit, random, size).moved(wall)
            }
            _ => continue,
        };
        stage.still.add(&mesh);
    }
}

/// Cars on the road and people on the pavements, on their way while the scene lasts.
fn traffic(stage: &mut Stage, random: &mut Random, road: f64, walk: f64) {
    let seconds = stage.seconds;
    let along = |from: DVec3, direction: f64, speed: f64| {
        let length = speed * seconds;
        let points = (0..4).map(|k| from + DVec3::X * direction * length * f64::from(k) / 3.0).collect();
        Motion { track: Track::Spline { points, seconds }, turn: Turn::Ahead, clock: Clock::ALWAYS }
    };
    for _ in 0..random.below(4) {
        let direction = random.sign();
        let speed = random.range(0.5, 10.0);
        let from = DVec3::new(-direction * random.range(-6.0, 12.0), -direction * road * 0.4, 0.0);
        let mesh = car(&mut stage.kit, random);
        let solid = Arc::new(Solid::new(mesh));
        stage.actors.push(Actor::rigid(solid, along(from, direction, speed)));
    }
    for _ in 0..random.count(1, 6) {
        let direction = random.sign();
        let speed = random.range(0.6, 2.2);
        let y = random.sign() * (road + random.range(0.2, walk * 0.8));
        let from = DVec3::new(random.range(-8.0, 8.0), y, 0.12);
        let height = random.range(1.5, 1.95);
        let mut motion = along(from, direction, speed);
        if random.chance(0.15) {
            motion = Motion {
                track: Track::Fixed(from),
                turn: Turn::Fixed(DQuat::from_rotation_z(random.range(0.0, 6.3))),
                clock: Clock::ALWAYS,
            };
        }
        let standing = matches!(motion.track, Track::Fixed(_));
        let actor = walker(&mut stage.kit, random, height, if standing { 0.0 } else { speed }, motion);
        stage.actors.push(actor);
    }
}
