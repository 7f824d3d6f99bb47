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

use std::path::{Path, PathBuf};

use super::sequences::{bars, lines, no_prediction, not_empty, skipped};
use crate::EvalError;
use crate::clips::ClipRule;
use crate::depth::{Alignment, DepthMetrics, Pixels, Range, mean, resize_cubic, score};
use crate::files::depth::{self as maps, DepthFrames, DepthMap, LAYOUTS};
use crate::files::folder;
use crate::stats::mean_of_numbers;
use crate::table::{Column, Protocol, Report, Row};

/// Frames of a KITTI sequence that the benchmark uses.
const KITTI_FRAMES: usize = 110;

/// Whose layout the truth has.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum DepthSet {
    /// KITTI, annotated depth.
    Kitti,
    /// MPI Sintel.
    Sintel,
    /// Bonn RGB-D Dynamic.
    Bonn,
    /// Arrays, in the layouts of predictions.
    Plain,
}

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
    if options.clips.is_empty() || options.alignments.is_empty() {
        let (name, value, expected) =
            ("rules of clips and alignments", String::from("empty"), "give at least one of each");
        return Err(EvalError::Parameter { name, value, expected });
    }
    let range = set.range();
    let ways: Vec<(ClipRule, Alignment)> =
        options.clips.iter().flat_map(|&rule| options.alignments.iter().map(move |&a| (rule, a))).collect();
    let mut of_ways: Vec<Vec<DepthMetrics>> = vec![Vec::new(); ways.len()];
    let (mut rows, mut missing, mut curves, mut notes) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for (name, sequence) in set.sequences(truth)? {
        let frames = match DepthFrames::find(predictions, &name) {
            Ok(Some(predicted)) => frames(&predicted, &sequence, set, range),
            Ok(None) => {
                missing.push(no_prediction(&name, LAYOUTS));
                continue;
            }
            Err(error) => Err(error),
        };
        match frames.and_then(|frames| scores(&frames, &ways, range)) {
            Ok(found) => {
                let quoted = mean(&found.by_way[0]);
                rows.push(Row { name: name.clone(), count: found.frames, values: values(&quoted) });
                curves.push((name.clone(), found.by_frame));
                for (all, own) in of_ways.iter_mut().zip(found.by_way) {
                    all.extend(own);
                }
                notes.extend(found.notes.into_iter().map(|note| format!("{name}: {note}")));
            }
            Err(error) => missing.push(skipped(&name, &error, false)),
        }
    }
    not_empty(rows.len(), &missing)?;
    let means = ways.iter().zip(&of_ways).map(|((rule, alignment), metrics)| {
        let values = if metrics.is_empty() { vec![f64::NAN; COLUMNS.len()] } else { values(&mean(metrics)) };
        Row { name: format!("{}, {}", rule.name(), alignment.name()), count: metrics.len(), values }
    });
    Ok(Report {
        kind: "depth",
        protocol: Protocol {
            data_set: set.name().into(),
            split: format!("sequences of {}", folder::name(truth)),
            clips: options.clips.iter().map(|rule| rule.name()).collect::<Vec<_>>().join("; "),
            frame: "z-depth in the camera of each frame".into(),
            alignment: "one for each sequence or clip; its name stands in the row".into(),
            mask: mask(range),
            mean: "over sequences or clips, weighted by their valid pixels".into(),
            ..Protocol::default()
        },
        columns: COLUMNS.to_vec(),
        rows: means.collect(),
        plots: vec![
            bars(&rows, 0, "Abs Rel of each sequence, the worst first".into(), "Abs Rel", false),
            lines(curves, "Abs Rel over time".into(), "Abs Rel"),
        ],
        sequences: rows,
        skipped: missing,
        notes,
    })
}

fn mask(range: Range) -> String {
    let below = range.max_depth.map_or(String::new(), |most| format!(" and below {most} m"));
    let clip = range.clip.map_or(String::new(), |most| format!("; aligned predictions at most {most} m"));
    format!("pixels with true depth above 0{below}{clip}")
}

fn values(m: &DepthMetrics) -> Vec<f64> {
    vec![m.abs_rel, m.delta[0], m.delta[1], m.delta[2], m.sq_rel, m.rmse, m.log_rmse]
}

impl DepthSet {
    fn range(self) -> Range {
        match self {
            Self::Kitti | Self::Plain => Range::KITTI,
            Self::Sintel => Range::SINTEL,
            Self::Bonn => Range::BONN,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Kitti => "KITTI",
            Self::Sintel => "Sintel",
            Self::Bonn => "Bonn RGB-D Dynamic",
            Self::Plain => "depth arrays",
        }
    }

    fn read(self, path: &Path) -> Result<DepthMap, EvalError> {
        match self {
            Self::Kitti => maps::read_kitti(path),
            Self::Sintel => maps::read_sintel(path),
            Self::Bonn | Self::Plain => maps::read_tum(path),
        }
    }

    /// Name and files of each sequence.
    fn sequences(self, truth: &Path) -> Result<Vec<(String, Truth)>, EvalError> {
        let mut found = Vec::new();
        match self {
            Self::Plain => {
                for path in folder::entries(truth)? {
                    let name = if path.is_dir() { folder::name(&path) } else { folder::stem(&path) };
                    if let Ok(Some(frames)) = DepthFrames::find(truth, &name) {
                        found.push((name, Truth::Frames(frames)));
                    }
                }
            }
            Self::Kitti | Self::Sintel | Self::Bonn => {
                let extension = if self == Self::Sintel { "dpt" } else { "png" };
                for dir in std::iter::once(truth.to_owned()).chain(folder::folders(truth)?) {
                    let inner = match self {
                        Self::Kitti => [dir.join("proj_depth/groundtruth/image_02"), dir.clone()],
                        Self::Bonn => [dir.join("depth_110"), dir.join("depth")],
                        Self::Sintel | Self::Plain => [dir.clone(), dir.clone()],
                    };
                    let files = inner.iter().filter(|path| path.is_dir()).map(|path| folder::files(path, extension));
                    let mut files =
                        files.collect::<Result<Vec<_>, _>>()?.into_iter().find(|f| !f.is_empty()).unwrap_or_default();
                    if self == Self::Kitti {
                        files.truncate(KITTI_FRAMES);
                    }
                    if !files.is_empty() {
                        found.push((folder::name(&dir), Truth::Files(files)));
                    }
                }
            }
        }
        let layout = match self {
            Self::Kitti => "folders of 16-bit PNG, or DRIVE/proj_depth/groundtruth/image_02",
            Self::Sintel => "folders with frame_0001.dpt and so on",
            Self::Bonn => "folders NAME/depth_110 or NAME/depth with 16-bit PNG",
            Self::Plain => LAYOUTS,
        };
        if found.is_empty() { Err(EvalError::NoSequences { layout, path: truth.to_owned() }) } else { Ok(found) }
    }
}

/// The true depth of a sequence.
enum Truth {
    Files(Vec<PathBuf>),
    Frames(DepthFrames),
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
