//! A scene while it is put together: what stands still, what moves, light, and where cameras may look.

use glam::{DVec2, DVec3, Vec3};

use crate::actor::Actor;
use crate::light::{Lamp, Light, Sky};
use crate::mesh::Mesh;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::things::{Arena, Kit, mover};

/// Something that cameras look at.
#[derive(Debug, Clone)]
pub(crate) struct Spot {
    pub(crate) focus: DVec3,
    /// How far from the focus a camera may aim.
    pub(crate) spread: DVec3,
    /// Between camera and focus, on the ground.
    pub(crate) distance: [f64; 2],
    /// Of the camera above z = 0, or above the ground where that is uneven.
    pub(crate) height: [f64; 2],
    pub(crate) uneven: bool,
    /// The box that cameras stay in.
    pub(crate) inside: [DVec3; 2],
}

impl Spot {
    /// Looks at a point near the spot instead, from nearer by; far ones are left out of view.
    pub(crate) fn aim(&mut self, at: DVec3) {
        let [low, high] = self.inside;
        if at.cmpge(low - 1.0).all() && at.cmple(high + 1.0).all() {
            self.focus = at;
            self.spread *= 0.4;
            self.distance[1] = self.distance[1].min(self.distance[0].midpoint(self.distance[1]));
        }
    }
}

/// Everything that a place makes.
#[derive(Debug)]
pub(crate) struct Stage {
    pub(crate) kit: Kit,
    pub(crate) still: Mesh,
    pub(crate) light: Light,
    pub(crate) actors: Vec<Actor>,
    pub(crate) spots: Vec<Spot>,
    pub(crate) seconds: f64,
    /// Discs on the floor that are taken.
    taken: Vec<(DVec2, f64)>,
}

impl Stage {
    pub(crate) fn new(kit: Kit, seconds: f64) -> Self {
        let light = Light { lamps: Vec::new(), sky: Sky::even(Vec3::ONE), fill: Vec3::ZERO, fog: None, closed: None };
        Self { kit, still: Mesh::default(), light, actors: Vec::new(), spots: Vec::new(), seconds, taken: Vec::new() }
    }

    /// Takes a disc on the floor if it is free.
    pub(crate) fn take(&mut self, centre: DVec2, radius: f64) -> bool {
        let free = self.taken.iter().all(|(other, r)| other.distance(centre) > r + radius);
        if free {
            self.taken.push((centre, radius));
        }
        free
    }

    /// As many things that move as the recipe says.
    pub(crate) fn movers(&mut self, random: &Random, recipe: &Recipe, arena: &Arena) {
        let mut random = random.fork("movers");
        if random.chance(recipe.still) {
            return;
        }
        // Few more often than many.
        let [least, most] = recipe.movers;
        let count = random.count(least, most).min(random.count(least, most));
        for k in 0..count {
            let mut random = random.at(k);
            let actor = mover(&mut self.kit, &mut random, arena, recipe.model_movers);
            self.actors.push(actor);
        }
    }
}

/// Colours of the sky, and the sun where it shines; a clear or cloudy day, evening, or an even grey.
pub(crate) fn daylight(random: &mut Random) -> (Sky, Option<Lamp>) {
    let height = random.range(0.12, 1.3);
    let turn = random.range(0.0, std::f64::consts::TAU);
    let towards = DVec3::new(height.cos() * turn.cos(), height.cos() * turn.sin(), height.sin());
    let low = (1.0 - height / 0.6).max(0.0) as f32;
    let blue = crate::palette::hsv(random.range(0.55, 0.62), random.range(0.3, 0.75), random.range(0.6, 0.95));
    let warm = Vec3::new(1.0, 0.75 - 0.3 * low, 0.55 - 0.4 * low);
    let pale = Vec3::new(0.8, 0.85, 0.9);
    let clear = random.chance(0.65);
    let clouds = if clear { random.range(0.0, 0.6) } else { random.range(0.6, 1.0) } as f32;
    let zenith = if clear { blue } else { pale * 0.7 };
    let horizon = pale.lerp(warm, low * 0.7) * random.range(0.8, 1.2) as f32;
    let strength = random.range(2.0, 5.0) as f32 * (1.0 - 0.6 * low);
    let sun = Vec3::new(1.0, 0.93, 0.82).lerp(warm, low) * strength;
    let ground = crate::palette::hsv(random.range(0.05, 0.3), 0.3, 0.35);
    let sky = Sky {
        zenith,
        horizon,
        ground,
        sun: towards.as_vec3(),
        sun_colour: if clear { sun * 4.0 } else { Vec3::ZERO },
        clouds,
        seed: random.bits() as u32,
    };
    let lamp = clear.then(|| Lamp::Sun { towards, spread: random.range(0.005, 0.03), colour: sun });
    (sky, lamp)
}
