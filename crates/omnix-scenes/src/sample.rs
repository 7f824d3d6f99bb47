//! Samples for training straight from a seed, without a file.

use glam::DVec3;
use omnix_data::{Dense, Flag, Motion, Sample, SampleParts, Time, Unit};
use omnix_geometry::Camera;
use rayon::prelude::*;

use crate::assets::Assets;
use crate::cast::{Geometry, Hit};
use crate::clean::{Refusal, judge_colours, judge_motion, judge_overlap};
use crate::error::ScenesError;
use crate::labels::{hits, is_outside, is_seen, moves, points};
use crate::picture::{draw, film};
use crate::recipe::Recipe;
use crate::scene::Scene;
use crate::shots::{Shot, shots};
use crate::smear::Later;
use crate::view::View;

/// Most images of a sample: paths are a square of it.
const MOST_IMAGES: usize = 64;
/// Most pixels of an image.
const MOST_PIXELS: usize = 1 << 24;

/// Which samples are made.
#[derive(Debug, Clone)]
pub struct Samples {
    /// What scenes are drawn from.
    pub recipe: Recipe,
    /// Photographs for textures, and models.
    pub assets: Assets,
    /// Width and height of the images.
    pub size: [usize; 2],
    /// Images of a sample.
    pub images: usize,
    /// Whether visibility is found out too: a ray for each pixel and time.
    pub visibility: bool,
    /// All samples follow from it and their index.
    pub seed: u64,
}

impl Samples {
    /// Sample number `index`.
    ///
    /// # Errors
    /// A recipe, size or number of images that cannot be, and an index of which every draw was refused.
    pub fn get(&self, index: u64) -> Result<Sample, ScenesError> {
        self.check()?;
        let mut reason = Refusal::Bare;
        for draw in 0..self.recipe.tries {
            let scene = Scene::draw(&self.recipe, &self.assets, self.seed, index, draw);
            match self.of(&scene) {
                Err(ScenesError::Refused { reason: why, .. }) => reason = why,
                other => return other,
            }
        }
        Err(ScenesError::Refused { seed: self.seed, index, tries: self.recipe.tries, reason })
    }

    fn check(&self) -> Result<(), ScenesError> {
        self.recipe.check()?;
        let [width, height] = self.size;
        let pixels = width.saturating_mul(height);
        if pixels == 0 || pixels.saturating_mul(self.images) > MOST_PIXELS {
            let value = format!("{width} x {height}, {} images", self.images);
            return Err(ScenesError::Recipe { field: "size", value, expected: "1 to 16,777,216 pixels in all images" });
        }
        if self.images == 0 || self.images > MOST_IMAGES {
            let value = self.images.to_string();
            return Err(ScenesError::Recipe { field: "images", value, expected: "1 to 64" });
        }
        Ok(())
    }

    /// A sample of a scene.
    pub(crate) fn of(&self, scene: &Scene) -> Result<Sample, ScenesError> {
        let random = scene.random.fork("sample");
        let shots =
            shots(&mut random.fork("shots"), self.images, self.recipe.frames, self.recipe.inputs, scene.index());
        let mut moments: Vec<usize> = shots.iter().map(|shot| shot.moment).collect();
        moments.sort_unstable();
        moments.dedup();
        let seconds = |moment: usize| moment as f64 * scene.frame_seconds();
        let states: Vec<Geometry> = moments.par_iter().map(|&moment| scene.geometry(seconds(moment))).collect();
        let state = |moment: usize| &states[moments.partition_point(|&m| m < moment)];
        let ends = [0, states.len() / 2, states.len() - 1].map(|k| (seconds(moments[k]), &states[k]));
        let rigs = shots.iter().map(|shot| shot.rig + 1).max().unwrap_or(1);
        let rigs = scene.rigs(&self.recipe, rigs, self.size, &ends)?;
        let views: Vec<View> = shots.iter().map(|shot| rigs[shot.rig].at(seconds(shot.moment), self.size)).collect();
        let hits: Vec<Vec<Option<Hit>>> =
            shots.par_iter().zip(&views).map(|(shot, view)| hits(view, state(shot.moment))).collect();
        let refused = |reason| scene.refused(1, reason);
        let seen: Vec<_> = (0..shots.len()).map(|k| (&views[k], state(shots[k].moment), &*hits[k])).collect();
        judge_overlap(&seen).map_err(refused)?;

        let all: Vec<&Geometry> = states.iter().collect();
        let (mut positions, mut moving) = (Vec::new(), Vec::new());
        for (shot, hits) in shots.iter().zip(&hits) {
            for shot in &shots {
                let then = points(hits, state(shot.moment));
                positions.extend(then.iter().map(|p| p.unwrap_or(DVec3::NAN).as_vec3().to_array()));
            }
            moving.extend(moves(hits, state(shot.moment), all.iter().copied()).into_iter().map(Flag::from));
        }
        if !scene.actors.is_empty() {
            let count = moving.iter().filter(|&&flag| flag == Flag::Yes).count();
            judge_motion(self.recipe.least_motion, states.len(), count, moving.len()).map_err(refused)?;
        }
        let half = scene.half_shutter(&self.recipe);
        let draw = |k: usize| {
            let film = film(&mut random.fork("film").at(shots[k].rig), &self.recipe);
            let then = half.map(|half| seconds(shots[k].moment) + half);
            let moved = then.map(|then| (scene.geometry(then), rigs[shots[k].rig].at(then, self.size)));
            let later = moved.as_ref().map(|(geometry, view)| Later { geometry, view: *view });
            let noise = random.fork("noise").at(k).bits();
            draw(scene, state(shots[k].moment), &views[k], &hits[k], later.as_ref(), &film, noise)
        };
        let images: Vec<Vec<u8>> = (0..shots.len()).into_par_iter().map(draw).collect();
        images.iter().try_for_each(|image| judge_colours(image)).map_err(refused)?;

        let mut visible = Vec::new();
        if self.visibility {
            for (source, own) in shots.iter().enumerate() {
                for (time, shot) in shots.iter().enumerate() {
                    let see = |hit: &Option<Hit>| match hit {
                        None => Flag::Unknown,
                        Some(hit) => {
                            let outside = is_outside(&views[source], state(own.moment), hit);
                            Flag::from(is_seen(&views[time], state(shot.moment), hit, outside))
                        }
                    };
                    visible.par_extend(hits[source].par_iter().map(see));
                }
            }
        }
        let far = |hit: &Option<Hit>| hit.map_or(f32::NAN, |hit| hit.t as f32);
        let parts = SampleParts {
            size: self.size.map(|v| v as u32),
            images: images.concat(),
            times: shots.iter().map(|shot| time(shot, scene)).collect(),
            cameras: views.iter().map(camera).collect(),
            depth: Some(hits.iter().flatten().map(far).collect()),
            moving: Some(moving),
            motion: Motion::Dense(Dense { positions, visible: self.visibility.then_some(visible) }),
            unit: Unit::Metre,
        };
        Ok(Sample::new(parts)?)
    }
}

fn time(shot: &Shot, scene: &Scene) -> Time {
    let seconds = Some(shot.moment as f64 * scene.frame_seconds());
    Time { video: shot.video, frame: shot.frame, moment: shot.moment as u32, seconds }
}

fn camera(view: &View) -> Camera {
    Camera { extrinsics: view.extrinsics(), intrinsics: view.intrinsics() }
}
