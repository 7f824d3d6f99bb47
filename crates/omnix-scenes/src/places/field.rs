//! Open land: hills with trees, bushes, rocks and grass about a level clearing.

use glam::{DVec2, DVec3};

use crate::noise::fractal;
use crate::palette;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::shapes::{blade, rock, sheet};
use crate::stage::{Spot, Stage, daylight};
use crate::things::{Arena, bench, bush, house, tree};

/// Half of the land's width in metres.
const HALF: f64 = 90.0;

/// Hills about a clearing at z = 0.
pub(crate) fn field(stage: &mut Stage, random: &Random, recipe: &Recipe) {
    let mut own = random.fork("field");
    let clearing = own.range(4.0, 9.0);
    let (high, wide, seed) = (own.log_range(0.5, 25.0), own.range(15.0, 50.0), own.bits() as u32);
    let ground = move |p: DVec2| {
        let free = ((p.length() - clearing) / 20.0).clamp(0.0, 1.0);
        let hills = f64::from(fractal((p / wide).extend(0.0).as_vec3(), 5, 0.0, seed)) - 0.5;
        let bumps = f64::from(fractal((p / 2.0).extend(3.0).as_vec3(), 3, 0.0, seed ^ 7)) - 0.5;
        hills * high * 2.0 * free * free * (3.0 - 2.0 * free) + bumps * 0.25
    };
    // Rows lie closer near the middle.
    let land = sheet(DVec2::splat(2.0), [110, 110], |p| {
        let q = DVec2::new(p.x * p.x.abs(), p.y * p.y.abs()) * 0.75 * HALF + p * 0.25 * HALF;
        q.extend(ground(q))
    });
    let earth = palette::ground(&mut own);
    stage.still.add(&stage.kit.made(land, earth));
    // Grown thickets and loose stones; near the clearing more of them, where cameras see them.
    let woods = own.range(0.0, 1.0);
    for _ in 0..(10.0 + 24.0 * woods) as usize {
        let place = DVec2::from_angle(own.range(0.0, 6.3)) * (clearing + own.range(0.0, 1.0).powi(2) * 45.0);
        let foot = place.extend(ground(place) - 0.1);
        let mesh = match own.weighted(&[woods + 0.2, 0.6, 0.6]) {
            0 => {
                let tall = own.range(3.0, 11.0);
                tree(&mut stage.kit, &mut own, tall)
            }
            1 => {
                let size = own.range(0.6, 1.8);
                bush(&mut stage.kit, &mut own, size)
            }
            _ => {
                let stone = palette::pavement(&mut own);
                let size = own.log_range(0.2, 2.0);
                let mesh = rock(size, own.range(0.2, 0.5), 10, own.bits() as u32);
                stage.kit.made(mesh, stone)
            }
        };
        stage.still.add(&mesh.moved(foot));
    }
    let green = stage.kit.slot(palette::leaves(&mut own));
    let tufts = own.below(120);
    for _ in 0..tufts {
        let place = DVec2::from_angle(own.range(0.0, 6.3)) * own.range(0.3, clearing + 3.0);
        let foot = place.extend(ground(place) - 0.02);
        for _ in 0..5 {
            let out = own.direction();
            let tip = DVec3::new(out.x * 0.5, out.y * 0.5, 1.0) * own.range(0.1, 0.4);
            stage.still.add(&blade(tip, 0.02, 0.3, 3).moved(foot).with(green));
        }
    }
    if own.chance(0.3) {
        let place = DVec2::new(own.range(-5.0, 5.0), clearing + own.range(3.0, 15.0));
        let width = own.range(7.0, 12.0);
        let mesh = house(&mut stage.kit, &mut own, width);
        stage.still.add(&mesh.moved(place.extend(ground(place) - 0.3)).turned(own.range(0.0, 6.3)));
    }
    if own.chance(0.3) {
        let place = own.inside(DVec2::splat(-clearing * 0.6), DVec2::splat(clearing * 0.6));
        stage
            .still
            .add(&bench(&mut stage.kit, &mut own).turned(own.range(0.0, 6.3)).moved(place.extend(ground(place))));
    }
    let (sky, sun) = daylight(&mut own);
    stage.light.fill = (sky.zenith + sky.horizon) * 0.1;
    stage.light.lamps.extend(sun);
    if own.chance(0.5) {
        stage.light.fog = Some((sky.horizon, own.log_range(0.002, 0.03) as f32));
    }
    stage.light.sky = sky;
    let half = DVec2::splat(clearing * 0.6);
    let arena = Arena {
        low: -half,
        high: half,
        floor: 0.05,
        tall: 3.0,
        seconds: stage.seconds,
        speed: recipe.speed.map(|speed| speed * 0.6),
        people: true,
    };
    stage.movers(random, recipe, &arena);
    stage.spots.push(Spot {
        focus: DVec3::new(0.0, 0.0, own.range(0.5, 1.2)),
        spread: DVec3::new(2.0, 2.0, 0.5),
        distance: [2.0, clearing * 1.3],
        height: [0.6, 2.5],
        uneven: true,
        inside: [DVec3::new(-40.0, -40.0, -20.0), DVec3::new(40.0, 40.0, 30.0)],
    });
}
