//! Cameras of a network over a data set.

use std::path::{Path, PathBuf};

use omnix_geometry::Camera;
use omnix_io::input::load_picture;

use super::benchmarks::pose_sequences;
use super::clip::{Framed, picture_error, see};
use super::network::{Network, Seen};
use super::scenes::{SceneData, clip_of, picks, sample};
use super::sequence::{Progress, chosen, clips, network_note, spread};
use crate::clips::ClipRule;
use crate::files::folder;
use crate::kinds::pose::{PoseSet, Sequences, name};
use crate::kinds::sequences::skipped;
use crate::pose::Trajectory;
use crate::table::Report;
use crate::{EvalError, Rigid};

/// Over what cameras are evaluated.
#[derive(Debug, Clone, Copy)]
pub enum PoseData<'a> {
    /// A benchmark, with its pictures.
    Benchmark(&'a Path, PoseSet),
    /// Scenes.
    Scenes(SceneData<'a>),
}

/// Runs a network over clips of a data set and evaluates its cameras; at most `most` sequences.
///
/// # Errors
/// A folder without sequences, [`EvalError::Nothing`] if none has a result, [`EvalError::Run`].
pub fn pose(
    network: &mut dyn Network,
    data: PoseData<'_>,
    rule: ClipRule,
    most: Option<usize>,
    progress: &mut Progress<'_>,
) -> Result<Report, EvalError> {
    let mut all = Sequences::new(rule)?;
    all.note(network_note(&network.name()));
    let (title, split, count, run) = match data {
        PoseData::Benchmark(folder, set) => {
            let sequences = pose_sequences(folder, set)?;
            let run: Vec<usize> = spread(sequences.len(), most).collect();
            for (done, &index) in (1..).zip(&run) {
                let sequence = &sequences[index];
                match &sequence.frames {
                    Ok((truth, pictures)) => {
                        let estimate = of_pictures(network, pictures, rule);
                        all.add(&sequence.name, estimate.map(|poses| (truth.clone(), stamped(truth, poses))))?;
                    }
                    Err(error) => all.skip(skipped(&sequence.name, error, false)),
                }
                progress(done, run.len() as u64);
            }
            (name(set).to_owned(), format!("sequences of {}", folder::name(folder)), sequences.len(), run.len())
        }
        PoseData::Scenes(data) => {
            let scenes = data.scenes()?;
            let videos = SceneData::videos(&scenes);
            let run: Vec<usize> = spread(videos.len(), most).collect();
            for (done, &index) in (1..).zip(&run) {
                let (found, video) = (&scenes[videos[index].0], videos[index].1);
                match &found.scene {
                    Ok(scene) => {
                        let label = format!("{}/{}", found.name, scene.videos()[video].name);
                        all.add(&label, of_video(network, scene.as_ref(), video, rule))?;
                    }
                    Err(error) => all.skip(skipped(&found.name, error, false)),
                }
                progress(done, run.len() as u64);
            }
            (data.name(), "all videos of all scenes".to_owned(), videos.len(), run.len())
        }
    };
    if let Some(note) = chosen(run, count) {
        all.note(note);
    }
    all.report(&title, &split)
}

/// The poses with the times of the truth: they are of the same pictures.
fn stamped(truth: &Trajectory, poses: Vec<Rigid>) -> Trajectory {
    Trajectory { stamps: truth.stamps.clone(), poses }
}

/// The pose of each picture, camera-to-world, in the world of its clip; the identity where a picture fills no clip.
fn of_pictures(network: &mut dyn Network, pictures: &[PathBuf], rule: ClipRule) -> Result<Vec<Rigid>, EvalError> {
    let mut poses = vec![Rigid::IDENTITY; pictures.len()];
    for places in clips(rule, pictures.len())? {
        let loaded = places.iter().map(|&place| load_picture(&pictures[place])).collect::<Result<Vec<_>, _>>();
        let framed = Framed::new(network, &loaded.map_err(picture_error)?)?;
        let seen = see(network, &framed.clip)?;
        place_poses(&seen, &places, &mut poses)?;
    }
    Ok(poses)
}

/// Truth and estimate of a video of a scene; both have the identity where a frame fills no clip.
fn of_video(
    network: &mut dyn Network,
    scene: &dyn omnix_data::Scene,
    video: usize,
    rule: ClipRule,
) -> Result<(Trajectory, Trajectory), EvalError> {
    let frames = scene.videos()[video].frames;
    let mut truth =
        Trajectory { stamps: (0..frames).map(|frame| frame as f64).collect(), poses: vec![Rigid::IDENTITY; frames] };
    let mut poses = truth.poses.clone();
    for places in clips(rule, frames)? {
        let sample = sample(scene, &picks(video, &places), network, false)?;
        let seen = see(network, &clip_of(&sample))?;
        place_poses(&seen, &places, &mut poses)?;
        for (&place, camera) in places.iter().zip(sample.cameras()) {
            truth.poses[place] = to_world(camera)?;
        }
    }
    let estimate = stamped(&truth, poses);
    Ok((truth, estimate))
}

fn place_poses(seen: &Seen, places: &[usize], poses: &mut [Rigid]) -> Result<(), EvalError> {
    for (&place, camera) in places.iter().zip(&seen.cameras) {
        poses[place] = to_world(camera)?;
    }
    Ok(())
}

/// Camera-to-world of a camera.
fn to_world(camera: &Camera) -> Result<Rigid, EvalError> {
    let pose = Rigid::from_rows(&camera.extrinsics.map(|row| row.map(f64::from)));
    Ok(pose.ok_or_else(|| EvalError::Nothing { reason: "a camera has a NaN or infinite number".to_owned() })?.inverse())
}
