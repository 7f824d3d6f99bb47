//! Video depth from folders: one alignment for each sequence or clip, means weighted by valid pixels.
//!
//! | set | truth of a sequence | frames | range |
//! |---|---|---|---|
//! | KITTI | a folder of PNG: `DRIVE/proj_depth/groundtruth/image_02`, or any folder of them | the first 110 | all |
//! | Sintel | `NAME/frame_0001.dpt`... | all | below 70 m, predictions up to 70 m |
//! | Bonn | `NAME/depth_110` or `NAME/depth`, PNG | all | below 70 m |
//! | plain | as predictions | all | all |
//!
//! Predictions: [`LAYOUTS`]. A prediction of another size is resized to the truth's (cubic), as published code does.

mod truth;

use std::path::Path;

use self::truth::Truth;
use super::sequences::{bars, lines, no_prediction, not_empty, or_fatal, skipped};
use crate::EvalError;
use crate::clips::ClipRule;
use crate::depth::{Alignment, DepthMetrics, Pixels, Range, mean, resize_cubic, score};
use crate::files::depth::{DepthFrames, LAYOUTS};
use crate::files::folder;
use crate::stats::mean_of_numbers;
use crate::table::{Column, Protocol, Report, Row, Skipped};

pub use self::truth::DepthSet;

/// What is evaluated. The first rule and alignment are those to quote.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// How sequences are cut.
    pub clips: Vec<ClipRule>,
    /// How predictions are brought onto the truth.
    pub alignments: Vec<Alignment>,
}

impl Default for Options {
    fn default() -> Self {
        Self { clips: vec![ClipRule::Whole], alignments: Alignment::ALL.to_vec() }
    }
}

const COLUMNS: [Column; 7] = [
    Column::less("abs_rel", ""),
    Column::more("delta_1.25"),
    Column::more("delta_1.25^2"),
    Column::more("delta_1.25^3"),
    Column::less("sq_rel", "m"),
    Column::less("rmse", "m"),
    Column::less("log_rmse", ""),
];

/// Evaluates the depth below `predictions` against the truth below `truth`.
///
/// # Errors
/// [`EvalError::NoSequences`] for a folder without truth, [`EvalError::Nothing`] if no sequence has a result.
pub fn evaluate(predictions: &Path, truth: &Path, set: DepthSet, options: &Options) -> Result<Report, EvalError> {
    let range = set.range();
    let mut sequences = Sequences::new(range, options)?;
    for (name, truth) in set.sequences(truth)? {
        match DepthFrames::find(predictions, &name) {
            Ok(Some(predicted)) => sequences.add(&name, frames(&predicted, &truth, set, range))?,
            Ok(None) => sequences.skip(no_prediction(&name, LAYOUTS)),
            Err(error) => sequences.add(&name, Err(error))?,
        }
    }
    sequences.report(set.name(), &format!("sequences of {}", folder::name(truth)))
}

/// Sequences evaluated one after another, and what became of them.
pub(crate) struct Sequences {
    range: Range,
    options: Options,
    ways: Vec<(ClipRule, Alignment)>,
    /// For each way, the metrics of all clips.
    of_ways: Vec<Vec<DepthMetrics>>,
    rows: Vec<Row>,
    missing: Vec<Skipped>,
    curves: Vec<(String, Vec<f64>)>,
    notes: Vec<String>,
}

impl Sequences {
    /// None so far.
    ///
    /// # Errors
    /// [`EvalError::Parameter`] unless there are a rule and an alignment.
    pub(crate) fn new(range: Range, options: &Options) -> Result<Self, EvalError> {
        if options.clips.is_empty() || options.alignments.is_empty() {
            let (name, value, expected) =
                ("rules of clips and alignments", String::from("empty"), "give at least one of each");
            return Err(EvalError::Parameter { name, value, expected });
        }
        let ways: Vec<(ClipRule, Alignment)> =
            options.clips.iter().flat_map(|&rule| options.alignments.iter().map(move |&a| (rule, a))).collect();
        let of_ways = vec![Vec::new(); ways.len()];
        let (rows, missing, curves, notes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        Ok(Self { range, options: options.clone(), ways, of_ways, rows, missing, curves, notes })
    }

    /// Evaluates a sequence by the scored pixels of each of its frames. What cannot be evaluated is remembered with its reason.
    ///
    /// # Errors
    /// [`EvalError::Run`] alone.
    pub(crate) fn add(&mut self, name: &str, frames: Result<Vec<Pixels>, EvalError>) -> Result<(), EvalError> {
        match or_fatal(frames.and_then(|frames| scores(&frames, &self.ways, self.range)))? {
            Ok(found) => {
                let quoted = mean(&found.by_way[0]);
                self.rows.push(Row { name: name.to_owned(), count: found.frames, values: values(&quoted) });
                self.curves.push((name.to_owned(), found.by_frame));
                for (all, own) in self.of_ways.iter_mut().zip(found.by_way) {
                    all.extend(own);
                }
                found.notes.into_iter().for_each(|note| self.note(name, &note));
            }
            Err(error) => self.missing.push(skipped(name, &error, false)),
        }
        Ok(())
    }

    /// A sequence that was not evaluated.
    pub(crate) fn skip(&mut self, skipped: Skipped) {
        self.missing.push(skipped);
    }

    /// What has to be known of a sequence.
    pub(crate) fn note(&mut self, name: &str, note: &str) {
        self.notes.push(format!("{name}: {note}"));
    }

    /// The report of all sequences.
    ///
    /// # Errors
    /// [`EvalError::Nothing`] if none has a result.
    pub(crate) fn report(self, data_set: &str, split: &str) -> Result<Report, EvalError> {
        not_empty(self.rows.len(), &self.missing)?;
        let means = self.ways.iter().zip(&self.of_ways).map(|((rule, alignment), metrics)| {
            let values = if metrics.is_empty() { vec![f64::NAN; COLUMNS.len()] } else { values(&mean(metrics)) };
            Row { name: format!("{}, {}", rule.name(), alignment.name()), count: metrics.len(), values }
        });
        Ok(Report {
            kind: "depth",
            protocol: Protocol {
                data_set: data_set.into(),
                split: split.into(),
                clips: self.options.clips.iter().map(|rule| rule.name()).collect::<Vec<_>>().join("; "),
                frame: "z-depth in the camera of each frame".into(),
                alignment: "one for each sequence or clip; its name stands in the row".into(),
                mask: mask(self.range),
                mean: "over sequences or clips, weighted by their valid pixels".into(),
                ..Protocol::default()
            },
            columns: COLUMNS.to_vec(),
            rows: means.collect(),
            plots: vec![
                bars(&self.rows, 0, "Abs Rel of each sequence, the worst first".into(), "Abs Rel", false),
                lines(self.curves, "Abs Rel over time".into(), "Abs Rel"),
            ],
            sequences: self.rows,
            skipped: self.missing,
            notes: self.notes,
        })
    }
}

fn mask(range: Range) -> String {
    let below = range.max_depth.map_or(String::new(), |most| format!(" and below {most} m"));
    let clip = range.clip.map_or(String::new(), |most| format!("; aligned predictions at most {most} m"));
    format!("pixels with true depth above 0{below}{clip}")
}

fn values(m: &DepthMetrics) -> Vec<f64> {
    vec![m.abs_rel, m.delta[0], m.delta[1], m.delta[2], m.sq_rel, m.rmse, m.log_rmse]
}

/// The scored pixels of each frame.
fn frames(predicted: &DepthFrames, truth: &Truth, set: DepthSet, range: Range) -> Result<Vec<Pixels>, EvalError> {
    let (count, places) = match truth {
        Truth::Files(files) => {
            let names: Vec<String> = files.iter().map(|path| folder::stem(path)).collect();
            (files.len(), predicted.matching(&names)?)
        }
        Truth::Frames(frames) => {
            EvalError::expect("frames", predicted.len(), frames.len())?;
            (frames.len(), (0..frames.len()).collect())
        }
    };
    let mut all = Vec::with_capacity(count);
    for (k, place) in places.into_iter().enumerate() {
        let truth = match truth {
            Truth::Files(files) => set.read(&files[k])?,
            Truth::Frames(frames) => frames.load(k)?,
        };
        let map = predicted.load(place)?;
        let depth = resize_cubic(&map.depth, map.size, truth.size)?;
        let mut pixels = Pixels::default();
        pixels.add(&depth, &truth.depth, range)?;
        all.push(pixels);
    }
    Ok(all)
}

/// A sequence's result.
struct Found {
    frames: usize,
    /// For each way, the metrics of each clip.
    by_way: Vec<Vec<DepthMetrics>>,
    by_frame: Vec<f64>,
    notes: Vec<String>,
}

fn scores(frames: &[Pixels], ways: &[(ClipRule, Alignment)], range: Range) -> Result<Found, EvalError> {
    let known: usize = frames.iter().map(Pixels::len).sum();
    let not_finite: usize = frames.iter().map(Pixels::not_finite).sum();
    if known == 0 {
        let reason = if not_finite > 0 { "its prediction is finite nowhere" } else { "its truth is known nowhere" };
        return Err(EvalError::Nothing { reason: reason.into() });
    }
    let mut notes = Vec::new();
    if not_finite > 0 {
        notes.push(format!(
            "{not_finite} of {} known pixels have no finite prediction and are not scored",
            known + not_finite
        ));
    }
    let (mut by_way, mut by_frame, mut said) = (Vec::with_capacity(ways.len()), Vec::new(), Vec::new());
    for (k, &(rule, alignment)) in ways.iter().enumerate() {
        let cut = rule.cut(frames.len())?;
        if cut.left_out > 0 && !said.contains(&rule) {
            said.push(rule);
            notes.push(format!(
                "{} of {} frames fill no clip ({}) and are left out",
                cut.left_out,
                frames.len(),
                rule.name()
            ));
        }
        let mut of_clips = Vec::new();
        for clip in &cut.clips {
            let found = score(&Pixels::joined(clip.iter().map(|&frame| &frames[frame])), alignment, range);
            of_clips.push(found.metrics);
            if k == 0 {
                by_frame.extend(found.by_frame);
            }
        }
        by_way.push(of_clips);
    }
    let first = by_way.first().is_some_and(|clips| clips.iter().any(|m| m.valid_pixels > 0));
    if !first || mean_of_numbers(by_frame.iter().copied()).1 == 0 {
        let reason = format!("its {} frames fill no clip with a known pixel", frames.len());
        return Err(EvalError::Nothing { reason });
    }
    Ok(Found { frames: frames.len(), by_way, by_frame, notes })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::files::npy::tests::npy;
    use crate::files::npz::tests::write;

    fn grey(path: &Path, value: u16) {
        image::ImageBuffer::<image::Luma<u16>, Vec<u16>>::from_pixel(6, 4, image::Luma([value])).save(path).unwrap();
    }

    #[test]
    fn kitti_in_both_layouts_and_what_is_missing() {
        let dir = tempfile::tempdir().unwrap();
        let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
        let official = truth.join("drive_a/proj_depth/groundtruth/image_02");
        for folder in [&official, &truth.join("drive_b_02"), &truth.join("drive_c_02"), &predicted.join("drive_b_02")] {
            std::fs::create_dir_all(folder).unwrap();
        }
        for (k, value) in [2560u16, 5120].into_iter().enumerate() {
            for folder in [&official, &truth.join("drive_b_02"), &truth.join("drive_c_02")] {
                grey(&folder.join(format!("{:010}.png", k + 5)), value);
            }
            let half = (f32::from(value) / 512.0).to_le_bytes().repeat(6);
            std::fs::write(predicted.join(format!("drive_b_02/{:010}.npy", k + 5)), npy("<f4", "(2, 3)", &half))
                .unwrap();
        }
        write(&predicted.join("drive_a.npz"), &[("depth", "|u1", "(3, 1, 1)", vec![1, 2, 3])]);
        let report = evaluate(&predicted, &truth, DepthSet::Kitti, &Options::default()).unwrap();
        assert_eq!(report.sequences.iter().map(|row| row.name.as_str()).collect::<Vec<_>>(), ["drive_b_02"]);
        let row = |name: &str| report.rows.iter().find(|row| row.name.ends_with(name)).unwrap();
        assert!(row(", scale").values[0] < 1e-5 && (row("metric").values[0] - 0.5).abs() < 1e-6, "{report:?}");
        assert!(report.skipped[0].reason.contains("prediction has 3 and the truth 2"), "{report:?}");
        assert!(report.skipped[1].reason.contains("no prediction of this name"), "{report:?}");
    }

    #[test]
    fn unknown_everywhere_is_said() {
        let dir = tempfile::tempdir().unwrap();
        let (truth, predicted) = (dir.path().join("truth"), dir.path().join("predicted"));
        for folder in [&truth, &predicted] {
            std::fs::create_dir(folder).unwrap();
            write(&folder.join("s.npz"), &[("depth", "|u1", "(2, 1, 2)", vec![0; 4])]);
        }
        let error = evaluate(&predicted, &truth, DepthSet::Plain, &Options::default()).unwrap_err();
        assert!(error.to_string().contains("known nowhere"), "{error}");
        write(&truth.join("s.npz"), &[("depth", "|u1", "(2, 1, 2)", vec![1; 4])]);
        let short = Options { clips: vec![ClipRule::Contiguous(16)], ..Options::default() };
        let error = evaluate(&predicted, &truth, DepthSet::Plain, &short).unwrap_err();
        assert!(error.to_string().contains("fill no clip"), "{error}");
        assert!(matches!(evaluate(&predicted, &truth, DepthSet::Sintel, &short), Err(EvalError::NoSequences { .. })));
    }
}
