//! TAPVid-3D from folders of NPZ archives: truth and predictions with the same names, either directly in the two folders or in one folder
//! for each source (`adt`, `drivetrack`, `pstudio`).
//!
//! A missing or unreadable prediction counts as zero, as in the benchmark. A sequence without a visible point is left out and said. Means
//! are plain: over sequences, then over sources; of clips first over those of a sequence. A clip's queries are the points visible in its
//! first frame.

use std::path::{Path, PathBuf};

use super::sequences::{bars, lines, mean, not_empty, or_fatal, skipped};
use crate::EvalError;
use crate::clips::{CLIP_FRAMES, ClipRule};
use crate::files::folder;
use crate::files::tapvid3d::{ClipPrediction, ClipTruth, read_prediction, read_truth};
use crate::stats::mean_of_numbers;
use crate::table::{Column, Protocol, Report, Row, Skipped};
use crate::tracks::Thresholds;
use crate::tracks::tapvid3d::{Clip, Scaling, TrackMetrics, distances, score};

/// What is evaluated. The first rule and scaling are those to quote.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How sequences are cut.
    pub clips: Vec<ClipRule>,
    /// How predictions are scaled.
    pub scalings: Vec<Scaling>,
    /// Within which distances a point counts.
    pub thresholds: Thresholds,
    /// The names of the files that are evaluated, with or without `.npz`; all if none.
    pub names: Option<Vec<String>>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            clips: vec![ClipRule::Whole, ClipRule::Contiguous(CLIP_FRAMES)],
            scalings: vec![Scaling::Median],
            thresholds: Thresholds::DepthAdaptive,
            names: None,
        }
    }
}

const COLUMNS: [Column; 4] = [Column::more("APD3D"), Column::more("AJ"), Column::more("OA"), Column::less("EPE", "m")];
const LAYOUT: &str = "NPZ archives in the folder, or in one folder for each source";

/// A way of cutting and scaling, and each sequence's result under it.
struct Way {
    rule: ClipRule,
    scaling: Scaling,
    /// By source, by sequence.
    results: Vec<Vec<Vec<f64>>>,
}

/// Reads a list of names, one a line; empty lines and comments (#) are passed over.
///
/// # Errors
/// [`EvalError::Read`], [`EvalError::Format`] for a list without a name.
pub fn read_names(path: &Path) -> Result<Vec<String>, EvalError> {
    let text = folder::text(path, "list of names")?;
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty() && !line.starts_with('#'));
    let names: Vec<String> = lines.map(str::to_owned).collect();
    if names.is_empty() { Err(EvalError::format("list of names", "it has no name", path)) } else { Ok(names) }
}

/// Evaluates the predictions below `predictions` against the truth below `truth`.
///
/// # Errors
/// [`EvalError::NoSequences`] for a folder without archives, [`EvalError::Nothing`] if no sequence has a result.
pub fn evaluate(predictions: &Path, truth: &Path, options: &Options) -> Result<Report, EvalError> {
    evaluate_with(truth, options, &mut |asked| {
        let folder = asked.source.map_or_else(|| predictions.to_owned(), |source| predictions.join(source));
        read_prediction(&folder.join(folder::name(asked.file)), asked.truth.frames, asked.truth.tracks)
    })
}

/// What a prediction is wanted for.
pub(crate) struct Asked<'a> {
    /// The folder of its source; none where the archives lie in the data set's own folder.
    pub(crate) source: Option<&'a str>,
    /// The archive of the truth.
    pub(crate) file: &'a Path,
    /// What it holds.
    pub(crate) truth: &'a ClipTruth,
    /// The frame in which each track is asked for.
    pub(crate) query_frames: &'a [usize],
}

/// Where predictions come from. An error of one counts as zero, [`EvalError::Run`] apart, which ends the evaluation.
pub(crate) type Predict<'a> = dyn FnMut(&Asked<'_>) -> Result<ClipPrediction, EvalError> + 'a;

/// The same of one archive: its truth and the frame in which each track is asked for.
type PredictOne<'a> = dyn FnMut(&ClipTruth, &[usize]) -> Result<ClipPrediction, EvalError> + 'a;

/// Evaluates predictions against the truth below `truth`.
///
/// # Errors
/// As [`evaluate`]; [`EvalError::Run`].
pub(crate) fn evaluate_with(truth: &Path, options: &Options, predict: &mut Predict<'_>) -> Result<Report, EvalError> {
    if options.clips.is_empty() || options.scalings.is_empty() {
        let (name, value, expected) =
            ("rules of clips and scalings", String::from("empty"), "give at least one of each");
        return Err(EvalError::Parameter { name, value, expected });
    }
    let sources = sources(truth)?;
    let mut ways = Vec::new();
    for &rule in &options.clips {
        let ways_of = |&scaling| Way { rule, scaling, results: vec![Vec::new(); sources.len()] };
        ways.extend(options.scalings.iter().map(ways_of));
    }
    let (mut rows, mut missing, mut curves, mut left_out) = (Vec::new(), Vec::new(), Vec::new(), 0);
    let mut asked: Vec<String> =
        options.names.iter().flatten().map(|name| name.trim_end_matches(".npz").to_owned()).collect();
    for (index, (source, below, files)) in sources.iter().enumerate() {
        for file in files {
            let stem = folder::stem(file);
            if options.names.is_some() {
                let Some(at) = asked.iter().position(|name| *name == stem) else { continue };
                asked.remove(at);
            }
            let name = if sources.len() > 1 { format!("{source}/{stem}") } else { stem };
            let source = below.then_some(source.as_str());
            let mut predicted =
                |truth: &ClipTruth, query_frames: &[usize]| predict(&Asked { source, file, truth, query_frames });
            match or_fatal(sequence(&mut predicted, file, options.thresholds, &mut ways, index))? {
                Ok(found) => {
                    rows.push(Row { name: name.clone(), count: found.frames, values: found.values });
                    curves.extend(found.by_frame.map(|values| (name.clone(), values)));
                    missing.extend(found.problem.map(|error| skipped(&name, &error, true)));
                    left_out += found.left_out;
                }
                Err(error) => missing.push(skipped(&name, &error, false)),
            }
        }
    }
    let reason = || "it is on the list of names, and there is no such truth".to_owned();
    missing.extend(asked.into_iter().map(|name| Skipped { name, reason: reason(), counts_as_zero: false }));
    not_empty(rows.len(), &missing)?;
    let scaling = options.scalings.first().map_or("none", |s| s.name());
    Ok(Report {
        kind: "tapvid3d",
        protocol: Protocol {
            data_set: "TAPVid-3D".into(),
            split: split(&sources, options),
            clips: options.clips.iter().map(|rule| rule.name()).collect::<Vec<_>>().join("; "),
            frame: "the camera of each time".into(),
            alignment: format!("{scaling}: one scale for each sequence or clip"),
            thresholds: format!("{} at 256 pixels on the shorter side", options.thresholds.name()),
            mask: "points visible in the truth; AJ and OA also use the predicted visibility".into(),
            mean: "over clips of a sequence, over sequences, over sources".into(),
        },
        columns: COLUMNS.to_vec(),
        rows: means(&sources, &ways),
        plots: vec![
            bars(&rows, 0, "APD3D of each sequence, the worst first".into(), "APD3D", true),
            lines(curves, "Mean distance of visible points over time".into(), "distance, m"),
        ],
        sequences: rows,
        skipped: missing,
        notes: notes(left_out),
    })
}

fn notes(left_out: usize) -> Vec<String> {
    let mut notes = vec!["EPE leaves out sequences without a readable prediction, which have no distance.".to_owned()];
    if left_out > 0 {
        notes
            .push(format!("{left_out} frames fill no clip, or begin clips without a visible point, and are left out."));
    }
    notes
}

fn split(sources: &[Archives], options: &Options) -> String {
    let names: Vec<&str> = sources.iter().map(|(name, ..)| name.as_str()).collect();
    let which =
        options.names.as_ref().map_or("all files".to_owned(), |names| format!("a list of {} names", names.len()));
    format!("{which} of {}", names.join(", "))
}

/// Means of every way: over all sources first, then of each.
fn means(sources: &[Archives], ways: &[Way]) -> Vec<Row> {
    let mut rows = Vec::new();
    for way in ways {
        let name = |source: &str| format!("{source}: {}, {}", way.rule.name(), way.scaling.name());
        let of_sources: Vec<Row> =
            sources.iter().zip(&way.results).map(|((source, ..), r)| mean(name(source), r, COLUMNS.len())).collect();
        if sources.len() > 1 {
            let values: Vec<Vec<f64>> =
                of_sources.iter().filter(|row| row.count > 0).map(|row| row.values.clone()).collect();
            let mut all = mean(name("all sources"), &values, COLUMNS.len());
            all.count = of_sources.iter().map(|row| row.count).sum();
            rows.push(all);
        }
        rows.extend(of_sources);
    }
    rows
}

/// How many archives are evaluated.
///
/// # Errors
/// As [`evaluate`].
pub(crate) fn count(truth: &Path, options: &Options) -> Result<usize, EvalError> {
    let asked = |file: &PathBuf| {
        let stem = folder::stem(file);
        options.names.as_ref().is_none_or(|names| names.iter().any(|name| name.trim_end_matches(".npz") == stem))
    };
    Ok(sources(truth)?.iter().flat_map(|(_, _, files)| files).filter(|file| asked(file)).count())
}

/// Name of a source, whether it has a folder of its own, and its files.
type Archives = (String, bool, Vec<PathBuf>);

/// The files of truth of each source.
fn sources(truth: &Path) -> Result<Vec<Archives>, EvalError> {
    let here = folder::files(truth, "npz")?;
    if !here.is_empty() {
        return Ok(vec![(folder::name(truth), false, here)]);
    }
    let mut found = Vec::new();
    for source in folder::folders(truth)? {
        let files = folder::files(&source, "npz")?;
        if !files.is_empty() {
            found.push((folder::name(&source), true, files));
        }
    }
    if found.is_empty() { Err(EvalError::NoSequences { layout: LAYOUT, path: truth.to_owned() }) } else { Ok(found) }
}

/// The result of a sequence under the first way.
struct Found {
    frames: usize,
    values: Vec<f64>,
    by_frame: Option<Vec<f64>>,
    problem: Option<EvalError>,
    left_out: usize,
}

/// Scores a sequence under every way. An error of the prediction gives zeros, an error of the truth is returned.
fn sequence(
    predict: &mut PredictOne<'_>,
    truth: &Path,
    thresholds: Thresholds,
    ways: &mut [Way],
    source: usize,
) -> Result<Found, EvalError> {
    let truth = read_truth(truth)?;
    let query_frames = truth.query_frames()?;
    if !truth.visible.contains(&true) {
        let reason = "no point of the truth is visible at any time, so that every share is 0/0".to_owned();
        return Err(EvalError::Nothing { reason });
    }
    let (predicted, problem) = match or_fatal(predict(&truth, &query_frames))? {
        Ok(predicted) => (Some(predicted), None),
        Err(error) => (None, Some(error)),
    };
    let mut found = Found { frames: truth.frames, values: Vec::new(), by_frame: None, problem, left_out: 0 };
    // Nothing enters the means before all ways have a result.
    let mut results = Vec::with_capacity(ways.len());
    for way in ways.iter() {
        let cut = way.rule.cut(truth.frames)?;
        let (mut of_clips, mut left_out, mut by_frame) = (Vec::new(), cut.left_out, Vec::new());
        for frames in &cut.clips {
            let picked = Picked::new(&truth, predicted.as_ref(), frames, &query_frames, way.rule);
            if picked.query_frames.is_empty() {
                left_out += frames.len();
                continue;
            }
            of_clips.push(if predicted.is_none() {
                values(&TrackMetrics::ZERO, f64::NAN)
            } else {
                let clip = picked.clip(&truth);
                let distances = distances(&clip, way.scaling)?;
                by_frame
                    .extend(distances.chunks(picked.query_frames.len()).map(|d| mean_of_numbers(d.iter().copied()).0));
                let epe = mean_of_numbers(distances.iter().copied()).0;
                values(&score(&clip, way.scaling, thresholds)?, epe)
            });
        }
        if results.is_empty() {
            found.by_frame = Some(by_frame).filter(|_| predicted.is_some());
        }
        found.left_out += left_out;
        results.push(of_clips);
    }
    for (way, of_clips) in ways.iter_mut().zip(results) {
        if !of_clips.is_empty() {
            let row = mean("", &of_clips, COLUMNS.len()).values;
            if found.values.is_empty() {
                found.values.clone_from(&row);
            }
            way.results[source].push(row);
        }
    }
    if found.values.is_empty() {
        let reason = format!("its {} frames fill no clip with a visible point", truth.frames);
        return Err(EvalError::Nothing { reason });
    }
    Ok(found)
}

fn values(metrics: &TrackMetrics, epe: f64) -> Vec<f64> {
    vec![metrics.average_pts_within, metrics.average_jaccard, metrics.occlusion_accuracy, epe]
}

/// The frames and tracks of a clip.
struct Picked {
    frames: usize,
    truth: Vec<[f64; 3]>,
    visible: Vec<bool>,
    predicted: Vec<[f64; 3]>,
    predicted_visible: Vec<bool>,
    query_frames: Vec<usize>,
}

impl Picked {
    fn new(
        truth: &ClipTruth,
        predicted: Option<&ClipPrediction>,
        frames: &[usize],
        queries: &[usize],
        rule: ClipRule,
    ) -> Self {
        let whole = rule == ClipRule::Whole;
        let first = frames.first().copied().unwrap_or(0);
        let tracks: Vec<usize> =
            (0..truth.tracks).filter(|n| whole || truth.visible[first * truth.tracks + n]).collect();
        let places: Vec<usize> = frames.iter().flat_map(|t| tracks.iter().map(move |n| t * truth.tracks + n)).collect();
        let points = |from: &[[f64; 3]]| places.iter().map(|&k| from[k]).collect();
        let flags = |from: &[bool]| places.iter().map(|&k| from[k]).collect();
        Self {
            frames: frames.len(),
            truth: points(&truth.points),
            visible: flags(&truth.visible),
            predicted: predicted.map_or_else(Vec::new, |p| points(&p.points)),
            predicted_visible: predicted.map_or_else(Vec::new, |p| flags(&p.visible)),
            query_frames: if whole { queries.to_vec() } else { vec![0; tracks.len()] },
        }
    }

    fn clip(&self, truth: &ClipTruth) -> Clip<'_> {
        Clip {
            frames: self.frames,
            truth: &self.truth,
            visible: &self.visible,
            predicted: &self.predicted,
            predicted_visible: &self.predicted_visible,
            query_frames: &self.query_frames,
            focal: truth.focal(),
        }
    }
}
