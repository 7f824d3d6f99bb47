//! Trajectories of a network over scenes whose paths are known.

use omnix_data::{Pick, Rule, draw};

use super::clip::see;
use super::network::Network;
use super::paths::NetworkPaths;
use super::scenes::{SceneData, clip_of, picks, sample};
use super::sequence::{Progress, chosen, network_note, spread};
use crate::EvalError;
use crate::clips::{CLIP_FRAMES, ClipRule};
use crate::kinds::sequences::{or_fatal, skipped};
use crate::kinds::trajectories::{Scenes, TruthSample};
use crate::table::{Report, Skipped};

/// The paper's kinds of input: clips of one camera; clips of several cameras one after the other in time; photographs of one moment and a
/// video.
pub const INPUTS: [&str; 3] = ["monocular", "pairs", "hybrid"];

/// Images are drawn by this seed, and the number of the scene.
const SEED: u64 = 0;

/// One run of the network.
struct Job {
    input: &'static str,
    scene: usize,
    name: String,
    /// Its images, or why there are none.
    picks: Result<Vec<Pick>, String>,
}

/// Runs a network over clips of scenes and evaluates its trajectories: of every video of one camera, and one clip a scene of the other
/// kinds of input; at most `most` of each kind.
///
/// # Errors
/// A folder without scenes, a kind of input that there is not or a network without trajectories ([`EvalError::Parameter`]),
/// [`EvalError::Nothing`] if no clip has a result, [`EvalError::Run`].
pub fn trajectories(
    network: &mut dyn Network,
    data: SceneData<'_>,
    rule: ClipRule,
    inputs: &[String],
    most: Option<usize>,
    progress: &mut Progress<'_>,
) -> Result<Report, EvalError> {
    if !network.has_paths() {
        let expected = "choose one with trajectories";
        return Err(EvalError::Parameter { name: "the network", value: network.name(), expected });
    }
    let scenes = data.scenes()?;
    let mut all = Scenes::default();
    all.note(network_note(&network.name()));
    let (mut jobs, mut left_out) = (Vec::new(), 0);
    for input in inputs {
        let Some(&input) = INPUTS.iter().find(|known| *known == input) else {
            let expected = "give monocular, pairs or hybrid";
            return Err(EvalError::Parameter { name: "the kind of input", value: input.clone(), expected });
        };
        let videos = SceneData::videos(&scenes);
        let count = if input == INPUTS[0] { videos.len() } else { scenes.len() };
        let kept: Vec<usize> = spread(count, most).collect();
        if let Some(note) = chosen(kept.len(), count) {
            all.note(format!("{input}: {note}"));
        }
        for index in kept {
            let (scene, video) = if input == INPUTS[0] { videos[index] } else { (index, 0) };
            let found = &scenes[scene];
            let open = match &found.scene {
                Ok(open) => open,
                Err(error) => {
                    let (name, reason) = (format!("{input}/{}", found.name), error.to_string());
                    all.skip(Skipped { name, reason, counts_as_zero: false });
                    continue;
                }
            };
            if input == INPUTS[0] {
                let own = &open.videos()[video];
                let cut = rule.cut(own.frames)?;
                left_out += cut.left_out;
                let name = format!("{input}/{}/{}", found.name, own.name);
                if cut.clips.is_empty() {
                    let reason = format!("its {} frames fill no clip ({})", own.frames, rule.name());
                    all.skip(Skipped { name: name.clone(), reason, counts_as_zero: false });
                }
                jobs.extend((0..).zip(&cut.clips).map(|(clip, frames): (usize, _)| Job {
                    input,
                    scene,
                    name: format!("{name}/clip {clip}"),
                    picks: Ok(picks(video, frames)),
                }));
            } else {
                let picks = drawn(open.videos(), input, images(rule), scene);
                jobs.push(Job { input, scene, name: format!("{input}/{}", found.name), picks });
            }
        }
    }
    for (done, job) in (1..).zip(&jobs) {
        match (&job.picks, &scenes[job.scene].scene) {
            (Ok(picks), Ok(scene)) => {
                if let Err(error) = or_fatal(run(network, scene.as_ref(), job, picks, &mut all))? {
                    all.skip(skipped(&job.name, &error, false));
                }
            }
            (Err(reason), _) => {
                all.skip(Skipped { name: job.name.clone(), reason: reason.clone(), counts_as_zero: false });
            }
            // A scene that cannot be opened has no job.
            (_, Err(_)) => {}
        }
        progress(done, jobs.len() as u64);
    }
    if left_out > 0 {
        all.note(format!("{left_out} frames of videos fill no clip and are left out"));
    }
    let clips = format!("{}; pairs and hybrid: {} images drawn by seed {SEED}", rule.name(), images(rule));
    all.report(&data.name(), &clips)
}

/// Images of a clip of several cameras.
const fn images(rule: ClipRule) -> usize {
    match rule {
        ClipRule::Whole => CLIP_FRAMES,
        ClipRule::Contiguous(n) | ClipRule::Uniform(n) => n,
    }
}

/// The images of several cameras of a scene.
fn drawn(videos: &[omnix_data::Video], input: &str, count: usize, scene: usize) -> Result<Vec<Pick>, String> {
    let shares = if input == INPUTS[1] { [0.0, 1.0, 0.0] } else { [0.0, 0.0, 1.0] };
    let rule = Rule { shares, step: 1, still: false };
    let picks = draw(videos, &rule, count, SEED, scene as u64).map_err(|error| error.to_string())?;
    // Of a scene with too few cameras a clip of one is drawn instead.
    if picks.iter().all(|pick| pick.as_video == 0) {
        let (have, frames) = (videos.len(), videos.iter().map(|video| video.frames).max().unwrap_or(0));
        return Err(format!("{have} camera(s) of up to {frames} frames do not make {count} images of several cameras"));
    }
    Ok(picks)
}

/// Runs the network over the images of a job and scores its paths.
fn run(
    network: &mut dyn Network,
    scene: &dyn omnix_data::Scene,
    job: &Job,
    picks: &[Pick],
    all: &mut Scenes,
) -> Result<(), EvalError> {
    let sample = sample(scene, picks, network, true)?;
    let seen = see(network, &clip_of(&sample))?;
    let mut paths = NetworkPaths::new(network, &seen, sample.size(), scene.path().to_owned())?;
    all.add(job.input, &job.name, &mut paths, &TruthSample(&sample))
}
