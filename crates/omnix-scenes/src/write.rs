//! Scenes as files: folder by folder, each whole or not there at all, so that a run can be stopped and go on.
//!
//! `OUT/scene_NNNNNN/` is made under a temporary name and renamed when all of its files are there; `scene.json` in it says what the
//! scene was made of and has the digest (BLAKE3) of every file. Scenes that are there are left as they are. A shard `i/n` writes the
//! scenes whose index is i modulo n, and holds a lock of its own; a folder that holds scenes of another recipe, seed or size is
//! refused.

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use omnix_tensors::AtomicFile;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::assets::Assets;
use crate::cast::{Geometry, Hit};
use crate::clean::{Refusal, judge_colours, judge_motion, judge_overlap};
use crate::error::ScenesError;
use crate::labels::{hits, moves};
use crate::picture::{draw, film};
use crate::recipe::Recipe;
use crate::rig::Rig;
use crate::scene::Scene;
use crate::smear::Later;
use crate::view::View;
use files::{Files, Take};

pub use more::Labels;

mod files;
mod more;
mod numpy;
mod shared;
#[cfg(test)]
mod tests;
mod ue;

const FORMAT: &str = "omnix-scenes-1";
/// A list of a scene's files is shorter than this.
const LONGEST: u64 = 64 << 20;
/// Width of the pictures that judge a scene before it is drawn.
const PREVIEW: usize = 42;

/// How scenes lie in files.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Layout {
    /// As the paper's own set.
    Ue,
    /// As newer trainers share it, with tracks.
    Omnix,
}

/// Scenes to be written.
#[derive(Debug, Clone)]
pub struct Job {
    /// What scenes are drawn from.
    pub recipe: Recipe,
    /// Photographs for textures, and models.
    pub assets: Assets,
    /// All scenes follow from it and their index.
    pub seed: u64,
    /// Scenes of all shards together.
    pub scenes: u64,
    /// Cameras of a scene.
    pub cameras: usize,
    /// Width and height of the pictures.
    pub size: [usize; 2],
    /// How they are written.
    pub layout: Layout,
    /// What is written beside what the layout has.
    pub labels: Labels,
    /// Which part of the scenes, of how many.
    pub shard: [u64; 2],
    /// The folder.
    pub out: PathBuf,
}

/// What was done with one scene.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Done {
    /// Its index.
    pub index: u64,
    /// Its folder.
    pub folder: PathBuf,
    /// Whether it was there already.
    pub kept: bool,
    /// Draws of scenes and cameras that were refused, by reason.
    pub refused: BTreeMap<Refusal, usize>,
}

/// `scene.json`.
#[derive(Debug, Serialize, Deserialize)]
struct About {
    format: String,
    /// Digest of what all scenes of a folder share: recipe, assets, seed, cameras, size, layout.
    job: String,
    seed: u64,
    index: u64,
    draw: usize,
    place: String,
    layout: Layout,
    unit: String,
    size: [usize; 2],
    cameras: usize,
    frames: usize,
    frame_seconds: f64,
    triangles: usize,
    actors: usize,
    refused: BTreeMap<String, usize>,
    files: BTreeMap<String, String>,
}

impl Job {
    /// Writes the shard's scenes that are not there yet, and `scenes-I-of-N.json` with their names at the end. `done` is told of each;
    /// `stop` is asked before each scene and each of its frames.
    ///
    /// # Errors
    /// [`ScenesError::Stopped`], a job that cannot be, a folder that another process writes to or that holds other scenes, a failure of writing (what is not
    /// whole is removed), and an index of which every draw was refused.
    pub fn run(&self, stop: &dyn Fn() -> bool, mut done: impl FnMut(&Done)) -> Result<(), ScenesError> {
        self.check()?;
        let write = |path: &Path| {
            let path = path.to_owned();
            move |source| ScenesError::Write { path, source }
        };
        fs::create_dir_all(&self.out).map_err(write(&self.out))?;
        let [shard, shards] = self.shard;
        let lock = self.out.join(format!(".omnix-scenes-{shard}-of-{shards}.lock"));
        let file = File::options().create(true).truncate(false).write(true).open(&lock).map_err(write(&lock))?;
        if let Err(TryLockError::WouldBlock) = file.try_lock() {
            return Err(ScenesError::InUse { path: self.out.clone() });
        }
        let job = self.digest();
        let mut names = Vec::new();
        for index in (shard..self.scenes).step_by(usize::try_from(shards).unwrap_or(usize::MAX)) {
            if stop() {
                return Err(ScenesError::Stopped);
            }
            let name = format!("scene_{index:06}");
            let folder = self.out.join(&name);
            let there = folder.exists();
            done(&if there { self.known(&folder, &job, index)? } else { self.scene(&folder, &job, index, stop)? });
            names.push(name);
        }
        let list = serde_json::json!({ "format": FORMAT, "job": job, "recipe": &self.recipe, "seed": self.seed,
            "shard": self.shard, "scenes": names });
        let path = self.out.join(format!("scenes-{shard}-of-{shards}.json"));
        let put = AtomicFile::create(&path).and_then(|mut file| {
            std::io::Write::write_all(&mut file, format!("{list:#}\n").as_bytes())?;
            file.commit()
        });
        put.map_err(write(&path))?;
        // The lock ends with the file; its name may stay where it cannot be removed.
        let _ = fs::remove_file(&lock);
        Ok(())
    }

    /// Bytes on disk that the shard's scenes take, roughly.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let [shard, shards] = self.shard;
        let scenes = self.scenes.saturating_sub(shard).div_ceil(shards.max(1));
        let images = scenes.saturating_mul(self.cameras as u64).saturating_mul(self.recipe.frames as u64);
        let pixels = self.size[0] as u64 * self.size[1] as u64;
        ue::bytes(images, pixels).saturating_add(images.saturating_mul(self.labels.bytes(pixels)))
    }

    fn check(&self) -> Result<(), ScenesError> {
        self.recipe.check()?;
        let wrong = |field, value: String, expected| Err(ScenesError::Recipe { field, value, expected });
        let [width, height] = self.size;
        if !(8..=8192).contains(&width) || !(8..=8192).contains(&height) {
            return wrong("size", format!("{width} x {height}"), "8 to 8192 pixels wide and high");
        }
        if self.cameras == 0 || self.cameras > 100 {
            return wrong("cameras", self.cameras.to_string(), "1 to 100");
        }
        let [shard, shards] = self.shard;
        if shard >= shards || shards > 1_000_000 {
            return wrong("shard", format!("{shard}/{shards}"), "i/n with i from 0 to n - 1, n up to 1000000");
        }
        if self.scenes > 1_000_000 {
            return wrong("scenes", self.scenes.to_string(), "up to 1000000");
        }
        Ok(())
    }

    fn digest(&self) -> String {
        let assets = self.assets.identity();
        let mut all =
            vec![serde_json::json!([FORMAT, &self.recipe, assets, self.seed, self.cameras, self.size, self.layout])];
        // Folders without further labels are those that they were before there were any.
        if self.labels != Labels::default() {
            all.push(serde_json::json!(self.labels));
        }
        let all: String = all.iter().map(ToString::to_string).collect();
        blake3::hash(all.as_bytes()).to_hex().to_string()
    }

    /// A scene that is there: it has to be one of this job.
    fn known(&self, folder: &Path, job: &str, index: u64) -> Result<Done, ScenesError> {
        let path = folder.join("scene.json");
        // What cannot be read is no scene of this job either.
        let about: Option<About> =
            omnix_tensors::read_text(&path, LONGEST).ok().and_then(|text| serde_json::from_str(&text).ok());
        match about {
            Some(about) if about.job == job && about.index == index => {
                Ok(Done { index, folder: folder.to_owned(), kept: true, refused: BTreeMap::new() })
            }
            _ => Err(ScenesError::OtherJob { path: folder.to_owned() }),
        }
    }

    fn scene(&self, folder: &Path, job: &str, index: u64, stop: &dyn Fn() -> bool) -> Result<Done, ScenesError> {
        let mut refused = BTreeMap::new();
        let (scene, states, rigs, draw) = self.chosen(index, &mut refused)?;
        let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        // The lock of the shard says that nobody else is at it: what is there is left from a run that was killed.
        let partial = folder.with_file_name(format!(".omnix-{name}.part"));
        if partial.exists() {
            fs::remove_dir_all(&partial).map_err(|source| ScenesError::Write { path: partial.clone(), source })?;
        }
        let files = Files::new(partial.clone());
        let written = self.images(&files, &scene, &states, &rigs, stop).and_then(|()| {
            let about = About {
                format: FORMAT.to_owned(),
                job: job.to_owned(),
                seed: self.seed,
                index,
                draw,
                place: scene.place().to_owned(),
                layout: self.layout,
                unit: "metre".to_owned(),
                size: self.size,
                cameras: self.cameras,
                frames: self.recipe.frames,
                frame_seconds: scene.frame_seconds(),
                triangles: scene.triangles(),
                actors: scene.actors.len(),
                refused: refused.iter().map(|(reason, count)| (reason.to_string(), *count)).collect(),
                files: files.digests(),
            };
            let text = serde_json::to_string_pretty(&about)
                .map_err(|error| ScenesError::Encode { reason: error.to_string() })?;
            files.put("scene.json", text.as_bytes())?;
            fs::rename(&partial, folder).map_err(|source| ScenesError::Write { path: folder.to_owned(), source })
        });
        if let Err(error) = written {
            // The first error is the one to tell.
            let _ = fs::remove_dir_all(&partial);
            return Err(error);
        }
        Ok(Done { index, folder: folder.to_owned(), kept: false, refused })
    }

    /// The first draw of a scene that is not refused, with its states and cameras.
    fn chosen(
        &self,
        index: u64,
        refused: &mut BTreeMap<Refusal, usize>,
    ) -> Result<(Scene, Vec<Geometry>, Vec<Rig>, usize), ScenesError> {
        let mut last = Refusal::Bare;
        for draw in 0..self.recipe.tries {
            let scene = Scene::draw(&self.recipe, &self.assets, self.seed, index, draw);
            let seconds = |frame: usize| frame as f64 * scene.frame_seconds();
            let states: Vec<Geometry> =
                (0..self.recipe.frames).into_par_iter().map(|frame| scene.geometry(seconds(frame))).collect();
            let end = states.len() - 1;
            let some = [0, end / 3, end / 2, 2 * end / 3, end].map(|frame| (seconds(frame), &states[frame]));
            let judged = scene.rigs(&self.recipe, self.cameras, self.size, &some).and_then(|rigs| {
                self.judge(&scene, &states, &rigs).map_err(|reason| scene.refused(1, reason)).map(|()| rigs)
            });
            match judged {
                Ok(rigs) => return Ok((scene, states, rigs, draw)),
                Err(ScenesError::Refused { reason, .. }) => {
                    *refused.entry(reason).or_default() += 1;
                    last = reason;
                }
                Err(error) => return Err(error),
            }
        }
        let (seed, tries) = (self.seed, self.recipe.tries);
        Err(ScenesError::Refused { seed, index, tries, reason: last })
    }

    /// Judges a scene by small pictures of all cameras at the middle of its time.
    fn judge(&self, scene: &Scene, states: &[Geometry], rigs: &[Rig]) -> Result<(), Refusal> {
        let size = [PREVIEW, (PREVIEW * self.size[1] / self.size[0]).clamp(8, 4 * PREVIEW)];
        let frame = states.len() / 2;
        let state = &states[frame];
        let views: Vec<View> = rigs.iter().map(|rig| rig.at(frame as f64 * scene.frame_seconds(), size)).collect();
        let all: Vec<Vec<Option<Hit>>> = views.par_iter().map(|view| hits(view, state)).collect();
        if !scene.actors.is_empty() {
            let count = all.iter().map(|hits| moves(hits, state, states).iter().filter(|&&moves| moves).count()).sum();
            judge_motion(self.recipe.least_motion, states.len(), count, all.len() * size[0] * size[1])?;
        }
        let seen: Vec<_> = views.iter().zip(&all).map(|(view, hits)| (view, state, &**hits)).collect();
        judge_overlap(&seen)?;
        views.par_iter().zip(&all).enumerate().try_for_each(|(camera, (view, hits))| {
            let film = film(&mut scene.random.fork("film").at(camera), &self.recipe);
            judge_colours(&draw(scene, state, view, hits, None, &film, 0))
        })
    }

    fn images(
        &self,
        files: &Files,
        scene: &Scene,
        states: &[Geometry],
        rigs: &[Rig],
        stop: &dyn Fn() -> bool,
    ) -> Result<(), ScenesError> {
        let mut kept = Vec::new();
        for (frame, state) in states.iter().enumerate() {
            if stop() {
                return Err(ScenesError::Stopped);
            }
            let seconds = frame as f64 * scene.frame_seconds();
            let moved = scene.half_shutter(&self.recipe).map(|half| (seconds + half, scene.geometry(seconds + half)));
            let take = |camera: usize| {
                let view = rigs[camera].at(seconds, self.size);
                let film = film(&mut scene.random.fork("film").at(camera), &self.recipe);
                let noise = scene.random.fork("noise").at(frame * rigs.len() + camera).bits();
                let hits = hits(&view, state);
                let later =
                    moved.as_ref().map(|(then, geometry)| Later { geometry, view: rigs[camera].at(*then, self.size) });
                let colours = draw(scene, state, &view, &hits, later.as_ref(), &film, noise);
                let moving = moves(&hits, state, states);
                Take { camera, frame, view, colours, hits, moving }
            };
            let more = |take: &Take| {
                let then = (frame + 1) as f64 * scene.frame_seconds();
                let next = states.get(frame + 1).map(|next| (rigs[take.camera].at(then, self.size), next));
                self.labels.write(files, take, state, next)
            };
            let cameras = (0..rigs.len()).into_par_iter();
            match self.layout {
                Layout::Ue => {
                    ue::meshes(files, scene, state, frame)?;
                    cameras.try_for_each(|camera| {
                        let take = take(camera);
                        more(&take)?;
                        ue::image(files, &take)
                    })?;
                }
                Layout::Omnix => {
                    let images = rigs.len() * states.len();
                    let one = |camera| {
                        let take = take(camera);
                        more(&take)?;
                        Ok(shared::keep(take, images, &scene.random))
                    };
                    kept.extend(cameras.map(one).collect::<Result<Vec<_>, ScenesError>>()?);
                }
            }
        }
        match self.layout {
            Layout::Ue => Ok(()),
            Layout::Omnix => shared::scene(files, kept, states, scene.frame_seconds()),
        }
    }
}
