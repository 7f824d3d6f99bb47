//! Depth of a network over a data set.

use std::path::{Path, PathBuf};

use omnix_io::input::load_picture;

use super::benchmarks::depth_sequences;
use super::clip::{Framed, picture_error, see};
use super::network::Network;
use super::scenes::{SceneData, clip_of, picks, sample};
use super::sequence::{Progress, chosen, clips, network_note, spread};
use crate::EvalError;
use crate::clips::ClipRule;
use crate::depth::{Alignment, Pixels, Range, resize_part};
use crate::files::folder;
use crate::kinds::depth::{DepthSet, Options, Sequences};
use crate::kinds::sequences::skipped;
use crate::table::Report;

/// Over what depth is evaluated.
#[derive(Debug, Clone, Copy)]
pub enum DepthData<'a> {
    /// A benchmark, with its pictures.
    Benchmark(&'a Path, DepthSet),
    /// Scenes with depth.
    Scenes(SceneData<'a>),
}

/// Runs a network over clips of a data set and evaluates its depth; at most `most` sequences.
///
/// # Errors
/// A folder without sequences, [`EvalError::Nothing`] if none has a result, [`EvalError::Run`].
pub fn depth(
    network: &mut dyn Network,
    data: DepthData<'_>,
    rule: ClipRule,
    alignments: &[Alignment],
    most: Option<usize>,
    progress: &mut Progress<'_>,
) -> Result<Report, EvalError> {
    let options = Options { clips: vec![rule], alignments: alignments.to_vec() };
    let name = network.name();
    let (mut report, count, run) = match data {
        DepthData::Benchmark(folder, set) => {
            let sequences = depth_sequences(folder, set)?;
            let mut all = Sequences::new(set.range(), &options)?;
            let run: Vec<usize> = spread(sequences.len(), most).collect();
            for (done, &index) in (1..).zip(&run) {
                let sequence = &sequences[index];
                match &sequence.frames {
                    Ok(frames) => all.add(&sequence.name, of_benchmark(network, set, frames, rule))?,
                    Err(error) => all.skip(skipped(&sequence.name, error, false)),
                }
                progress(done, run.len() as u64);
            }
            let report = all.report(set.name(), &format!("sequences of {}", folder::name(folder)))?;
            (report, sequences.len(), run.len())
        }
        DepthData::Scenes(data) => {
            let scenes = data.scenes()?;
            let videos = SceneData::videos(&scenes);
            let mut all = Sequences::new(Range::KITTI, &options)?;
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
            (all.report(&data.name(), "all videos of all scenes")?, videos.len(), run.len())
        }
    };
    report.notes.insert(0, network_note(&name));
    report.notes.extend(chosen(run, count));
    Ok(report)
}

/// The scored pixels of each frame of a sequence; none of frames that fill no clip.
fn of_benchmark(
    network: &mut dyn Network,
    set: DepthSet,
    frames: &[(PathBuf, PathBuf)],
    rule: ClipRule,
) -> Result<Vec<Pixels>, EvalError> {
    let mut all = vec![Pixels::default(); frames.len()];
    for places in clips(rule, frames.len())? {
        let pictures = places.iter().map(|&place| load_picture(&frames[place].1)).collect::<Result<Vec<_>, _>>();
        let framed = Framed::new(network, &pictures.map_err(picture_error)?)?;
        let seen = see(network, &framed.clip)?;
        let size = framed.clip.size.map(|side| side as usize);
        for (image, &place) in places.iter().enumerate() {
            let truth = set.read(&frames[place].0)?;
            let own = &seen.depth[image * size[0] * size[1]..(image + 1) * size[0] * size[1]];
            let predicted = resize_part(own, size, framed.part(image), truth.size)?;
            all[place].add(&predicted, &truth.depth, set.range())?;
        }
    }
    Ok(all)
}

/// The same of a video of a scene.
fn of_video(
    network: &mut dyn Network,
    scene: &dyn omnix_data::Scene,
    video: usize,
    rule: ClipRule,
) -> Result<Vec<Pixels>, EvalError> {
    let frames = scene.videos()[video].frames;
    let mut all = vec![Pixels::default(); frames];
    for places in clips(rule, frames)? {
        let sample = sample(scene, &picks(video, &places), network, false)?;
        if sample.depth(0).is_none() {
            let reason = format!("a scene of {} has no depth: choose another kind of evaluation", scene.set().name());
            return Err(EvalError::Nothing { reason });
        }
        let seen = see(network, &clip_of(&sample))?;
        for (image, (&place, own)) in places.iter().zip(seen.depth.chunks(sample.pixels())).enumerate() {
            all[place].add(own, sample.depth(image).unwrap_or_default(), Range::KITTI)?;
        }
    }
    Ok(all)
}
