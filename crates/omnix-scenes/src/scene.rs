//! A whole scene of a seed and an index, and its state at any time.

use std::sync::Arc;

use crate::actor::Actor;
use crate::assets::Assets;
use crate::cast::{Geometry, Solid};
use crate::clean::Refusal;
use crate::error::ScenesError;
use crate::light::Light;
use crate::material::Material;
use crate::palette::Photos;
use crate::places;
use crate::random::Random;
use crate::recipe::Recipe;
use crate::rig::Rig;
use crate::stage::{Spot, Stage};
use crate::things::Kit;

/// Triangles of all imported models of a scene.
const MOST_IMPORTED: usize = 600_000;

/// A dynamic scene.
#[derive(Debug)]
pub struct Scene {
    still: Arc<Solid>,
    pub(crate) actors: Vec<Actor>,
    pub(crate) materials: Vec<Material>,
    pub(crate) light: Light,
    spots: Vec<Spot>,
    place: &'static str,
    frame_seconds: f64,
    pub(crate) random: Random,
    seed: u64,
    index: u64,
}

impl Scene {
    /// The scene of a seed and an index. The same recipe and assets give the same scene.
    ///
    /// # Errors
    /// A recipe with values that cannot be.
    pub fn compose(recipe: &Recipe, assets: &Assets, seed: u64, index: u64) -> Result<Self, ScenesError> {
        recipe.check()?;
        Ok(Self::draw(recipe, assets, seed, index, 0))
    }

    /// Draw number `draw` of a scene: others are made where one is refused.
    pub(crate) fn draw(recipe: &Recipe, assets: &Assets, seed: u64, index: u64, draw: usize) -> Self {
        let random = Random::new(seed, index, "scene").at(draw);
        let mut own = random.fork("scene");
        let [low, high] = recipe.frames_per_second;
        let frame_seconds = 1.0 / own.log_range(low, high);
        let [least, most] = recipe.models;
        let kit = Kit {
            photos: Photos(assets.photos.clone()),
            models: assets.models.clone(),
            left: random.fork("models").count(least, most),
            triangles: MOST_IMPORTED,
            share: 0.3,
            ..Kit::default()
        };
        let mut stage = Stage::new(kit, frame_seconds * recipe.frames as f64);
        let weights = recipe.places;
        let choice = [weights.room, weights.desk, weights.street, weights.field, weights.studio];
        let place = match own.weighted(&choice) {
            0 => {
                places::room(&mut stage, &random, recipe);
                "room"
            }
            1 => {
                places::desk(&mut stage, &random, recipe);
                "desk"
            }
            2 => {
                places::street(&mut stage, &random, recipe);
                "street"
            }
            3 => {
                places::field(&mut stage, &random, recipe);
                "field"
            }
            _ => {
                places::studio(&mut stage, &random, recipe);
                "studio"
            }
        };
        Self {
            still: Arc::new(Solid::new(stage.still)),
            actors: stage.actors,
            materials: stage.kit.materials,
            light: stage.light,
            spots: stage.spots,
            place,
            frame_seconds,
            random,
            seed,
            index,
        }
    }

    /// Kind of the place, as recipes name it.
    #[must_use]
    pub const fn place(&self) -> &'static str {
        self.place
    }

    pub(crate) const fn index(&self) -> u64 {
        self.index
    }

    /// Number of triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        let moving = self.actors.iter().flat_map(|actor| &actor.parts).map(|part| part.solid.mesh.triangles.len());
        self.still.mesh.triangles.len() + moving.sum::<usize>()
    }

    /// Seconds between two frames.
    #[must_use]
    pub const fn frame_seconds(&self) -> f64 {
        self.frame_seconds
    }

    /// Half of the time for which the shutter is open, in seconds; nothing in scenes with sharp pictures.
    pub(crate) fn half_shutter(&self, recipe: &Recipe) -> Option<f64> {
        let mut random = self.random.fork("shutter");
        random.chance(recipe.motion_blur).then(|| random.range(0.05, 0.4) * self.frame_seconds)
    }

    /// Where everything is at a time.
    pub(crate) fn geometry(&self, t: f64) -> Geometry {
        let movers = self.actors.iter().flat_map(|actor| actor.at(t)).collect();
        Geometry::new(Arc::clone(&self.still), movers)
    }

    /// `count` cameras around the scene. `geometries` are states in the order of their times, in which no camera may be blocked.
    ///
    /// # Errors
    /// [`ScenesError::Refused`] where every draw of one was refused.
    pub(crate) fn rigs(
        &self,
        recipe: &Recipe,
        count: usize,
        size: [usize; 2],
        geometries: &[(f64, &Geometry)],
    ) -> Result<Vec<Rig>, ScenesError> {
        let random = self.random.fork("cameras");
        let middle = geometries.get(geometries.len() / 2).map_or(0.0, |(t, _)| *t);
        let first = random.clone().range(0.0, std::f64::consts::TAU);
        let mut rigs = Vec::with_capacity(count);
        for k in 0..count {
            let mut reason = Refusal::Bare;
            let aimed = random.at(k).chance(recipe.aimed);
            let good = (0..recipe.tries).find_map(|draw| {
                let mut random = random.at(k).at(draw);
                let mut spot = self.spots.get(random.below(self.spots.len()))?.clone();
                if aimed && !self.actors.is_empty() {
                    spot.aim(self.actors[random.below(self.actors.len())].middle(middle));
                }
                let turn = first + (k as f64 + random.range(-0.4, 0.4)) / count as f64 * std::f64::consts::TAU;
                // After some draws any side will do.
                let turn = if draw > 5 || count == 1 { random.range(0.0, std::f64::consts::TAU) } else { turn };
                let mut rig = Rig::draw(&mut random, recipe, &spot, turn, self.frame_seconds * recipe.frames as f64);
                if spot.uneven {
                    rig.above(geometries.first()?.1);
                }
                let judged = geometries.iter().try_for_each(|(t, geometry)| rig.judge(geometry, *t, size));
                reason = judged.err().unwrap_or(reason);
                judged.ok().map(|()| rig)
            });
            rigs.push(good.ok_or_else(|| self.refused(recipe.tries, reason))?);
        }
        Ok(rigs)
    }

    pub(crate) fn refused(&self, tries: usize, reason: Refusal) -> ScenesError {
        ScenesError::Refused { seed: self.seed, index: self.index, tries, reason }
    }
}
