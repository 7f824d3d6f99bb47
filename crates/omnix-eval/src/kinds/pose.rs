//! Camera poses from folders: ATE and RPE after one Sim(3) for each sequence or clip.
//!
//! | set | truth of a sequence NAME | its poses |
//! |---|---|---|
//! | Sintel | `NAME/frame_0001.cam`... | all, positions relative to their mean |
//! | TUM | `NAME/rgb.txt` and `NAME/groundtruth.txt` | matched within 0.02 s, every third, the first 90 |
//! | plain | `NAME.txt` or `NAME.tum` in TUM's format | all |
//!
//! A prediction is `NAME.txt`, `NAME.tum` or `NAME/trajectory.tum` (as omnix writes it), in TUM's format. With as many poses as the truth, or
//! as its clip, they belong together in order; else by time, within 0.01 s.

use std::path::{Path, PathBuf};

use super::sequences::{bars, lines, mean, no_prediction, not_empty, or_fatal, skipped};
use crate::EvalError;
use crate::clips::ClipRule;
use crate::files::{camera, folder};
use crate::pose::{Alignment, TOLERANCE_S, Trajectory, absolute, associate, video_pose};
use crate::table::{Column, Protocol, Report, Row, Skipped};

/// Whose layout the truth has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PoseSet {
    /// MPI Sintel, `camdata_left`.
    Sintel,
    /// TUM RGB-D.
    Tum,
    /// Files in TUM's format.
    Plain,
}

const COLUMNS: [Column; 3] =
    [Column::less("ATE", "m"), Column::less("RPE_trans", "m"), Column::less("RPE_rot", "degrees")];
const PREDICTIONS: &str = "NAME.txt, NAME.tum or NAME/trajectory.tum in TUM's format";

/// Evaluates the trajectories below `predictions` against those below `truth`.
///
/// # Errors
/// [`EvalError::NoSequences`] for a folder without truth, [`EvalError::Nothing`] if no sequence has a result.
pub fn evaluate(predictions: &Path, truth: &Path, set: PoseSet, rule: ClipRule) -> Result<Report, EvalError> {
    let mut all = Sequences::new(rule)?;
    for (name, path) in sequences(truth, set)? {
        match prediction(predictions, &name) {
            Some(predicted) => {
                let pair = read(&path, set).and_then(|truth| Ok((truth, camera::read_tum(&predicted)?)));
                all.add(&name, pair)?;
            }
            None => all.skip(no_prediction(&name, PREDICTIONS)),
        }
    }
    all.report(name(set), &format!("sequences of {}", folder::name(truth)))
}

/// Sequences evaluated one after another, and what became of them.
pub(crate) struct Sequences {
    rule: ClipRule,
    rows: Vec<Row>,
    missing: Vec<Skipped>,
    curves: Vec<(String, Vec<f64>)>,
    left_out: usize,
    notes: Vec<String>,
}

impl Sequences {
    /// None so far.
    ///
    /// # Errors
    /// [`EvalError::Parameter`] for clips of fewer than two poses.
    pub(crate) fn new(rule: ClipRule) -> Result<Self, EvalError> {
        rule.cut(0)?;
        let (rows, missing, curves, notes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ok(Self { rule, rows, missing, curves, left_out: 0, notes })
    }

    /// Evaluates a sequence, truth and estimate. What cannot be evaluated is remembered with its reason.
    ///
    /// # Errors
    /// [`EvalError::Run`] alone.
    pub(crate) fn add(
        &mut self,
        name: &str,
        pair: Result<(Trajectory, Trajectory), EvalError>,
    ) -> Result<(), EvalError> {
        match or_fatal(pair.and_then(|(truth, estimate)| sequence(&truth, &estimate, self.rule)))? {
            Ok(found) => {
                self.rows.push(Row { name: name.to_owned(), count: found.poses, values: found.values });
                self.curves.push((name.to_owned(), found.by_pose));
                self.left_out += found.left_out;
                let problems = found.problems.iter();
                self.missing.extend(problems.map(|(clip, error)| skipped(&format!("{name}, {clip}"), error, false)));
            }
            Err(error) => self.missing.push(skipped(name, &error, false)),
        }
        Ok(())
    }

    /// A sequence that was not evaluated.
    pub(crate) fn skip(&mut self, skipped: Skipped) {
        self.missing.push(skipped);
    }

    /// What else has to be known.
    pub(crate) fn note(&mut self, note: String) {
        self.notes.push(note);
    }

    /// The report of all sequences.
    ///
    /// # Errors
    /// [`EvalError::Nothing`] if none has a result.
    pub(crate) fn report(mut self, data_set: &str, split: &str) -> Result<Report, EvalError> {
        not_empty(self.rows.len(), &self.missing)?;
        let values: Vec<Vec<f64>> = self.rows.iter().map(|row| row.values.clone()).collect();
        self.notes.push(
            "The same numbers by evo, of one sequence: `evo_ape tum TRUTH PREDICTION --align --correct_scale --t_max_diff 0.01` and \
             `evo_rpe tum TRUTH PREDICTION --align --correct_scale --delta 1 --delta_unit f --pose_relation trans_part` (`angle_deg`)."
                .to_owned(),
        );
        if self.left_out > 0 {
            self.notes.push(format!("{} poses fill no clip and are left out.", self.left_out));
        }
        Ok(Report {
            kind: "pose",
            protocol: Protocol {
                data_set: data_set.into(),
                split: split.into(),
                clips: self.rule.name(),
                alignment: "Sim(3) of positions, least squares, one for each sequence or clip".into(),
                mask: "poses of the same time, at most 0.01 s apart; rmse; RPE of consecutive poses".into(),
                mean: "over clips of a sequence, over sequences".into(),
                ..Protocol::default()
            },
            columns: COLUMNS.to_vec(),
            rows: vec![mean(format!("{data_set}: {}", self.rule.name()), &values, COLUMNS.len())],
            plots: vec![
                bars(&self.rows, 0, "ATE of each sequence, the worst first".into(), "ATE, m", false),
                lines(self.curves, "Distance of each pose after the Sim(3)".into(), "distance, m"),
            ],
            sequences: self.rows,
            skipped: self.missing,
            notes: self.notes,
        })
    }
}

pub(crate) fn name(set: PoseSet) -> &'static str {
    match set {
        PoseSet::Sintel => "Sintel",
        PoseSet::Tum => "TUM RGB-D",
        PoseSet::Plain => "trajectories in TUM's format",
    }
}

/// Name and path of each sequence of the truth; the folder itself may be one.
pub(crate) fn sequences(truth: &Path, set: PoseSet) -> Result<Vec<(String, PathBuf)>, EvalError> {
    let is_one = |dir: &Path| match set {
        PoseSet::Sintel => folder::files(dir, "cam").is_ok_and(|files| !files.is_empty()),
        PoseSet::Tum => dir.join("rgb.txt").is_file() || dir.join("groundtruth.txt").is_file(),
        PoseSet::Plain => false,
    };
    let mut found: Vec<(String, PathBuf)> = Vec::new();
    if set == PoseSet::Plain {
        for extension in ["txt", "tum"] {
            found.extend(folder::files(truth, extension)?.into_iter().map(|path| (folder::stem(&path), path)));
        }
        found.sort();
    } else if is_one(truth) {
        found.push((folder::name(truth), truth.to_owned()));
    } else {
        found
            .extend(folder::folders(truth)?.into_iter().filter(|dir| is_one(dir)).map(|dir| (folder::name(&dir), dir)));
    }
    let layout = match set {
        PoseSet::Sintel => "folders with frame_0001.cam and so on",
        PoseSet::Tum => "folders with rgb.txt and groundtruth.txt",
        PoseSet::Plain => "files NAME.txt or NAME.tum",
    };
    if found.is_empty() { Err(EvalError::NoSequences { layout, path: truth.to_owned() }) } else { Ok(found) }
}

pub(crate) fn read(path: &Path, set: PoseSet) -> Result<Trajectory, EvalError> {
    match set {
        PoseSet::Sintel => camera::read_sintel_sequence(path),
        PoseSet::Tum => camera::read_tum_sequence(path),
        PoseSet::Plain => camera::read_tum(path),
    }
}

fn prediction(root: &Path, name: &str) -> Option<PathBuf> {
    let places = [format!("{name}.txt"), format!("{name}.tum"), format!("{name}/trajectory.tum")];
    places.into_iter().map(|place| root.join(place)).find(|path| path.is_file())
}

/// A sequence's result.
struct Found {
    poses: usize,
    values: Vec<f64>,
    by_pose: Vec<f64>,
    left_out: usize,
    /// Clips without a result.
    problems: Vec<(String, EvalError)>,
}

fn sequence(truth: &Trajectory, estimate: &Trajectory, rule: ClipRule) -> Result<Found, EvalError> {
    let cut = rule.cut(truth.len())?;
    if cut.clips.is_empty() {
        let reason = format!("its {} poses fill no clip ({})", truth.len(), rule.name());
        return Err(EvalError::Nothing { reason });
    }
    // As many as the whole truth: the same times, also where only some of them make a clip.
    let same = estimate.len() == truth.len();
    let stamped = Trajectory { stamps: truth.stamps.clone(), poses: estimate.poses.clone() };
    let estimate = if same { &stamped } else { estimate };
    let (mut of_clips, mut problems, mut by_pose, mut poses) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for (index, places) in cut.clips.iter().enumerate() {
        let clip = truth.select(places);
        let result = associate(&clip, estimate, TOLERANCE_S).and_then(|(reference, estimate)| {
            let (errors, _) = absolute(&reference, &estimate, Alignment::Sim3)?;
            Ok((video_pose(&reference, &estimate)?, errors.translation))
        });
        match result {
            Ok((found, distances)) => {
                of_clips.push(vec![found.ate, found.rpe_translation, found.rpe_rotation]);
                poses += distances.len();
                by_pose.extend(distances);
            }
            Err(error) if cut.clips.len() == 1 => return Err(error),
            Err(error) => problems.push((format!("clip {index}"), error)),
        }
    }
    if of_clips.is_empty() {
        let reason = problems.first().map_or_else(String::new, |(_, error)| error.to_string());
        return Err(EvalError::Nothing {
            reason: format!("none of its {} clips has a result; the first: {reason}", problems.len()),
        });
    }
    let values = mean("", &of_clips, COLUMNS.len()).values;
    Ok(Found { poses, values, by_pose, left_out: cut.left_out, problems })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A curve in TUM's format, scaled.
    fn write(path: &Path, poses: usize, scale: f64, first: f64) {
        let line = |k: usize| {
            let a = k as f64 * 0.2;
            format!(
                "{} {} {} {} 0 0 {} 1\n",
                first + k as f64,
                scale * a.cos(),
                scale * a.sin(),
                scale * a * a,
                a * 0.1
            )
        };
        std::fs::write(path, (0..poses).map(line).collect::<String>()).unwrap();
    }

    #[test]
    fn sequences_are_scored_and_the_rest_is_named() {
        let dir = tempfile::tempdir().unwrap();
        let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
        for folder in [&truth, &predicted] {
            std::fs::create_dir(folder).unwrap();
        }
        for name in ["a", "b", "c", "d"] {
            write(&truth.join(format!("{name}.txt")), 34, 1.0, 0.0);
        }
        write(&predicted.join("a.tum"), 34, 0.5, 1000.0);
        write(&predicted.join("b.txt"), 20, 0.5, 7000.0);
        std::fs::write(predicted.join("c.txt"), "no pose\n").unwrap();
        let report = evaluate(&predicted, &truth, PoseSet::Plain, ClipRule::Contiguous(16)).unwrap();
        assert_eq!(report.sequences.len(), 1);
        assert!(report.sequences[0].count == 32 && report.rows[0].values.iter().all(|v| *v < 1e-6), "{report:?}");
        let reasons: Vec<&str> = report.skipped.iter().map(|s| s.reason.as_str()).collect();
        assert!(reasons[0].contains("no time of the prediction") && reasons[1].contains("line 1"), "{reasons:?}");
        assert!(
            reasons[2].contains("no prediction") && report.notes.iter().any(|n| n.starts_with("2 poses")),
            "{report:?}"
        );
    }

    #[test]
    fn nothing_at_all_is_an_error() {
        let dir = tempfile::tempdir().unwrap();
        let run = || evaluate(dir.path(), dir.path(), PoseSet::Tum, ClipRule::Whole);
        assert!(matches!(run(), Err(EvalError::NoSequences { .. })));
        std::fs::create_dir(dir.path().join("s")).unwrap();
        write(&dir.path().join("s/groundtruth.txt"), 4, 1.0, 0.0);
        assert!(matches!(run(), Err(EvalError::Nothing { .. })));
    }
}
