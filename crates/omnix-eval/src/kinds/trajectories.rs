//! The paper's own benchmark: dense trajectories of scenes, of the first image and of all, of the foreground and of everything.
//!
//! A scene's prediction is a run of omnix with `--export tracks` (`NAME/exports/tracks/NNNNNN.npz`, or the archives in `NAME` itself). Its truth
//! is such a folder too ([`TruthFolder`]), or a sample of ground truth ([`TruthSample`]). Scenes may lie in one folder for each kind of input
//! (such as `monocular`, `pairs`, `hybrid`), which then has means of its own.
//!
//! Where the truth is a folder of scenes of a data set (as `omnix scenes` writes them), each of their videos is a scene of its own: the
//! prediction of the video VIDEO of the scene NAME is the run over its pictures, `NAME/VIDEO`; of a scene of one video also `NAME`.
//!
//! Prediction and truth are each moved into the frame of their first camera. A prediction of another size than the truth is read at the nearest
//! pixel. Beside each number stands what the same prediction would get if nothing moved: each pixel stays where it is at the time of its image.

mod prediction;
mod scene;
mod truth;

use std::path::{Path, PathBuf};

use omnix_data::{Pick, ReadOptions, Sample, sets};

use self::prediction::PredictionFolder;
use self::scene::{Way, scene, ways};
use self::truth::LAYOUT;
use super::sequences::{bars, lines, no_prediction, not_empty, or_fatal, skipped};
use crate::EvalError;
use crate::files::{folder, tracks};
use crate::table::{Column, Protocol, Report, Row, Skipped};
use crate::tracks::dense::{DenseScore, mean};

pub(crate) use self::prediction::ScenePrediction;
pub use self::truth::{SceneTruth, TruthFolder, TruthSample};

const COLUMNS: [Column; 3] = [Column::more("APD3D"), Column::less("EPE", "m"), Column::more("APD_fixed")];

/// Evaluates the runs below `predictions` against the truth below `truth`: archives of tracks, or scenes of a data set.
///
/// # Errors
/// [`EvalError::NoSequences`] for a folder without truth, [`EvalError::Nothing`] if no scene has a result.
pub fn evaluate(predictions: &Path, truth: &Path) -> Result<Report, EvalError> {
    let mut scenes = Scenes::default();
    let found = find(truth)?;
    if found.is_empty() {
        let layout = "folders of omnix runs with --export tracks, or scenes of a data set";
        // What the folder holds is no data set either: then it is no truth of ours at all.
        let none = |_| EvalError::NoSequences { layout, path: truth.to_owned() };
        for place in sets::find(truth, None).map_err(none)? {
            scenes.add_videos(&folder::name(&place), &place, predictions);
        }
    }
    for (group, name, dir) in found {
        let place = predictions.join(&group).join(&name);
        // A single scene: its prediction is the folder itself.
        let place = if group.is_empty() && !place.is_dir() && dir == truth { predictions.to_owned() } else { place };
        let label = if group.is_empty() { name } else { format!("{group}/{name}") };
        scenes.add_folder(&group, &label, &place, TruthFolder::open(&dir).as_ref().map(|t| t as &dyn SceneTruth));
    }
    scenes.report(&folder::name(truth), "the images of a run")
}

/// Group, name and folder of each scene that is a folder of archives: the folder itself, its folders, or theirs.
fn find(truth: &Path) -> Result<Vec<(String, String, PathBuf)>, EvalError> {
    let is_scene = |dir: &Path| tracks::archives(dir).is_ok_and(|archives| !archives.is_empty());
    if is_scene(truth) {
        return Ok(vec![(String::new(), folder::name(truth), truth.to_owned())]);
    }
    let mut found = Vec::new();
    for dir in folder::folders(truth)? {
        if is_scene(&dir) {
            found.push((String::new(), folder::name(&dir), dir));
        } else {
            let inner = folder::folders(&dir)?.into_iter().filter(|path| is_scene(path));
            found.extend(inner.map(|path| (folder::name(&dir), folder::name(&path), path)));
        }
    }
    Ok(found)
}

/// All images of a video with all that is known about them.
fn video(place: &Path, video: usize) -> Result<Sample, EvalError> {
    let scene = sets::open(place, None)?;
    let frames = scene.videos().get(video).map_or(0, |video| video.frames);
    let picks: Vec<Pick> = (0..frames).map(|frame| Pick::plain(video, frame)).collect();
    Ok(omnix_data::read(scene.as_ref(), &picks, &ReadOptions { dense: true, ..ReadOptions::default() })?)
}

/// Scenes evaluated one after another, and what became of them.
#[derive(Debug, Default)]
pub(crate) struct Scenes {
    results: Vec<(String, Vec<Option<DenseScore>>)>,
    rows: Vec<Row>,
    curves: Vec<(String, Vec<f64>)>,
    missing: Vec<Skipped>,
    notes: Vec<String>,
}

impl Scenes {
    /// Evaluates a scene whose prediction lies in a folder; `group` is the kind of input that it belongs to, or empty. What cannot be
    /// evaluated is remembered with its reason.
    fn add_folder(&mut self, group: &str, name: &str, prediction: &Path, truth: Result<&dyn SceneTruth, &EvalError>) {
        if !prediction.is_dir() {
            self.missing.push(no_prediction(name, LAYOUT));
            return;
        }
        match (truth, PredictionFolder::open(prediction)) {
            (Ok(truth), Ok(mut prediction)) => {
                let found = scene(&mut prediction, truth);
                self.keep(group, name, found);
            }
            (Err(error), _) => self.missing.push(skipped(name, error, false)),
            (_, Err(error)) => self.missing.push(skipped(name, &error, false)),
        }
    }

    /// Evaluates each video of a scene of a data set that has a prediction; the others are named.
    fn add_videos(&mut self, name: &str, place: &Path, predictions: &Path) {
        let videos = match sets::open(place, None) {
            Ok(scene) => scene.videos().to_vec(),
            Err(error) => return self.missing.push(skipped(name, &error, false)),
        };
        for (index, own) in videos.iter().enumerate() {
            let label = format!("{name}/{}", own.name);
            let folder = predictions.join(&label);
            let alone = videos.len() == 1 && !folder.is_dir();
            let folder = if alone { predictions.join(name) } else { folder };
            if !folder.is_dir() {
                self.missing.push(no_prediction(&label, LAYOUT));
                continue;
            }
            let sample = video(place, index);
            let truth = sample.as_ref().map(TruthSample);
            self.add_folder("", &label, &folder, truth.as_ref().map(|t| t as &dyn SceneTruth).map_err(|e| *e));
        }
    }

    /// Evaluates a scene. What cannot be evaluated is remembered with its reason.
    ///
    /// # Errors
    /// [`EvalError::Run`] alone.
    pub(crate) fn add(
        &mut self,
        group: &str,
        name: &str,
        prediction: &mut dyn ScenePrediction,
        truth: &dyn SceneTruth,
    ) -> Result<(), EvalError> {
        let found = or_fatal(scene(prediction, truth))?;
        self.keep(group, name, found);
        Ok(())
    }

    /// A scene that was not evaluated.
    pub(crate) fn skip(&mut self, skipped: Skipped) {
        self.missing.push(skipped);
    }

    /// What else has to be known.
    pub(crate) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    fn keep(&mut self, group: &str, name: &str, found: Result<scene::Found, EvalError>) {
        match found {
            Ok(found) => {
                let quoted = found.by_way[0].map_or([f64::NAN; 3], |s| values(&s));
                self.rows.push(Row { name: name.to_owned(), count: found.images, values: quoted.to_vec() });
                self.curves.push((name.to_owned(), found.by_time));
                self.results.push((group.to_owned(), found.by_way));
                self.notes.extend(found.notes.into_iter().map(|note| format!("{name}: {note}")));
            }
            Err(error) => self.missing.push(skipped(name, &error, false)),
        }
    }

    /// The report of all scenes.
    ///
    /// # Errors
    /// [`EvalError::Nothing`] if none has a result.
    pub(crate) fn report(self, data_set: &str, clips: &str) -> Result<Report, EvalError> {
        not_empty(self.rows.len(), &self.missing)?;
        let mut groups: Vec<&str> = self.results.iter().map(|(group, _)| group.as_str()).collect();
        groups.sort_unstable();
        groups.dedup();
        let mut rows = means("", &self.results.iter().map(|(_, ways)| ways.as_slice()).collect::<Vec<_>>());
        if groups.len() > 1 || groups.first().is_some_and(|group| !group.is_empty()) {
            for group in groups {
                let own: Vec<_> =
                    self.results.iter().filter(|(g, _)| g == group).map(|(_, ways)| ways.as_slice()).collect();
                rows.extend(means(&format!("{group}: "), &own));
            }
        }
        Ok(Report {
            kind: "trajectories",
            protocol: Protocol {
                data_set: data_set.into(),
                split: "all scenes of the folder".into(),
                clips: clips.into(),
                frame: "world: the first camera of prediction and of truth; the source camera where the row says so".into(),
                alignment: "ratio of median norms, of the scored points of a source image or of all points of a scene".into(),
                thresholds: "depth-adaptive, 1, 2, 4, 8, 16 pixels at 256 pixels on the shorter side, true depth in the source camera \
                             (distances below); APD_fixed: 0.1, 0.3, 0.5, 1 m"
                    .into(),
                mask: "ALL: pixels and times with known truth, seen or hidden; FG: of those the pixels that move".into(),
                mean: "over pixels and times of a source image, over source images, over scenes".into(),
            },
            columns: COLUMNS.to_vec(),
            rows,
            plots: vec![
                bars(&self.rows, 1, "EPE of each scene, the worst first".into(), "EPE, m", false),
                lines(self.curves, "Mean distance over time".into(), "distance, m"),
            ],
            sequences: self.rows,
            skipped: self.missing,
            notes: self.notes,
        })
    }
}

fn values(score: &DenseScore) -> [f64; 3] {
    [score.apd, score.epe, score.apd_fixed]
}

/// A row for each way: the mean over scenes that have a score.
fn means(prefix: &str, scenes: &[&[Option<DenseScore>]]) -> Vec<Row> {
    let row = |(k, way): (usize, &Way)| {
        let scores: Vec<DenseScore> = scenes.iter().filter_map(|ways| ways[k]).collect();
        let values = mean(&scores).map_or([f64::NAN; 3], |score| values(&score));
        Row { name: format!("{prefix}{}", way.name()), count: scores.len(), values: values.to_vec() }
    };
    ways().iter().enumerate().map(row).collect()
}

#[cfg(test)]
mod tests;
