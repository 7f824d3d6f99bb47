//! `omnix eval`: predictions against truth, by the numbers of papers: from files, or of a network that is run over a data set.

mod efficiency;
mod network;
mod predictions;
mod runner;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use omnix_data::Set;
use omnix_eval::clips::{CLIP_FRAMES, ClipRule};
use omnix_eval::depth::Alignment;
use omnix_eval::kinds::depth::{self, DepthSet};
use omnix_eval::kinds::pose::{self, PoseSet};
use omnix_eval::kinds::{tapvid3d, trajectories};
use omnix_eval::run::{self, DepthData, PoseData, SceneData};
use omnix_eval::table::Report;
use omnix_eval::tracks::Thresholds;
use omnix_eval::tracks::tapvid3d::Scaling;

use self::predictions::{Place, Predictions};
use super::data::set_of;
use crate::error::CliError;
use crate::ui::{self, Ui};

/// What is measured.
#[derive(Debug, Subcommand)]
pub(crate) enum EvalCommand {
    /// Video depth of KITTI, Sintel, Bonn or arrays: Abs Rel, delta, RMSE.
    Depth(DepthArgs),
    /// Camera poses of Sintel, TUM or trajectories in TUM's format: ATE, RPE.
    Pose(PoseArgs),
    /// 3D point tracks of TAPVid-3D: APD3D, AJ, OA, EPE.
    Tapvid3d(Tapvid3dArgs),
    /// Trajectories of all pixels: APD3D and EPE of the first image and of all, of what moves and of everything. Predictions are runs
    /// with `--export tracks --all-tracks`; the truth is such runs, or scenes as `omnix scenes` writes them, for each video
    /// VIDEO of a scene NAME a run NAME/VIDEO.
    Trajectories(TrajectoryArgs),
    /// A network on samples with known depth, cameras and motion, made from a seed or read from a data set: each figure apart, beside the
    /// trivial answers. Opens a device.
    Network(network::NetworkArgs),
    /// What a network costs: parameters, operations counted both ways, planned and measured memory, time. Opens a device.
    Efficiency(efficiency::EfficiencyArgs),
}

/// Arguments of `omnix eval depth`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct DepthArgs {
    #[command(flatten)]
    from: Predictions,
    /// Whose layout and protocol the truth has: kitti (annotated depth), sintel and bonn (up to 70 m), plain (arrays, in the layouts of
    /// predictions; from files alone). With --data also a data set of scenes, as `omnix data check` names them. [default with --data: the set
    /// that its scenes look like]
    #[arg(long, value_name = "SET", value_parser = depth_set)]
    set: Option<Truth<DepthSet>>,
    /// Frames evaluated together: whole, contiguous:N or uniform:N; of files more than one may be given, the first is quoted. [default:
    /// contiguous:16, and of files whole too]
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse)]
    clips: Vec<ClipRule>,
    /// How predictions are brought onto the truth; may be given again, the first is quoted. [default: all, scale first]
    #[arg(long, value_name = "HOW")]
    align: Vec<Aligned>,
}

/// Arguments of `omnix eval pose`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct PoseArgs {
    #[command(flatten)]
    from: Predictions,
    /// Whose layout and protocol the truth has: sintel (.cam, positions relative to their mean), tum (rgb.txt and groundtruth.txt; every
    /// third match, the first 90), plain (NAME.txt or NAME.tum; from files alone). With --data also a data set of scenes, as `omnix data check`
    /// names them. [default with --data: the set that its scenes look like]
    #[arg(long, value_name = "SET", value_parser = pose_set)]
    set: Option<Truth<PoseSet>>,
    /// Poses evaluated together: whole, contiguous:N or uniform:N. [default: whole; with --data contiguous:16]
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse)]
    clips: Option<ClipRule>,
}

/// Arguments of `omnix eval tapvid3d`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct Tapvid3dArgs {
    #[command(flatten)]
    from: Predictions,
    /// Text file with the names to evaluate, one a line, such as those of minival. [default: all files of the truth]
    #[arg(long, value_name = "FILE")]
    names: Option<PathBuf>,
    /// Frames evaluated together: whole, contiguous:N or uniform:N; of files more than one may be given, the first is quoted. [default: of
    /// files whole and contiguous:16; with --data contiguous:16]
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse)]
    clips: Vec<ClipRule>,
    /// How predictions are scaled; may be given again, the first is quoted.
    #[arg(long, value_name = "HOW", default_values = ["median"])]
    scaling: Vec<Scaled>,
    /// Fixed distances of 1 cm to 2.56 m instead of those of 1 to 16 pixels at the true depth.
    #[arg(long)]
    fixed_thresholds: bool,
}

/// Arguments of `omnix eval trajectories`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct TrajectoryArgs {
    #[command(flatten)]
    from: Predictions,
    /// With --data: the data set, where more than one would fit, as `omnix data check` names them.
    #[arg(long, value_name = "SET", value_parser = set_of, requires = "data")]
    set: Option<Set>,
    /// With --data: frames run and evaluated together: whole, contiguous:N or uniform:N. [default: contiguous:16]
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse, requires = "data")]
    clips: Option<ClipRule>,
    /// With --data: the paper's kinds of input: monocular (every video), pairs (two or three videos, one after the other in time), hybrid
    /// (photographs and a video); the last two once a scene.
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_values = run::INPUTS, requires = "data")]
    inputs: Vec<String>,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Aligned {
    /// The scale of least absolute errors.
    Scale,
    /// The ratio of medians.
    Median,
    /// Scale and shift as published tables have them.
    ScaleShift,
    /// Scale and shift by least squares.
    LeastSquares,
    /// None.
    Metric,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Scaled {
    /// The ratio of median norms; the benchmark's own.
    Median,
    /// The ratio of mean norms.
    Mean,
    /// None.
    None,
    /// By each track's depth in its query frame.
    PerTrajectory,
    /// By each point's depth.
    Reproduce2d,
    /// The ratio of median norms in the query frames.
    MedianOnQueries,
}

/// A benchmark with a protocol of its own, or a data set of scenes.
#[derive(Debug, Clone, Copy)]
enum Truth<T> {
    Benchmark(T),
    Scenes(Set),
}

fn depth_set(name: &str) -> Result<Truth<DepthSet>, String> {
    const ALL: [(&str, DepthSet); 4] = [
        ("kitti", DepthSet::Kitti),
        ("sintel", DepthSet::Sintel),
        ("bonn", DepthSet::Bonn),
        ("plain", DepthSet::Plain),
    ];
    truth_of(name, &ALL)
}

fn pose_set(name: &str) -> Result<Truth<PoseSet>, String> {
    truth_of(name, &[("sintel", PoseSet::Sintel), ("tum", PoseSet::Tum), ("plain", PoseSet::Plain)])
}

fn truth_of<T: Copy>(name: &str, benchmarks: &[(&str, T)]) -> Result<Truth<T>, String> {
    match benchmarks.iter().find(|(own, _)| *own == name) {
        Some((_, set)) => Ok(Truth::Benchmark(*set)),
        None => set_of(name).map(Truth::Scenes).map_err(|scenes| {
            let names: Vec<&str> = benchmarks.iter().map(|(own, _)| *own).collect();
            format!("use one of {}; with --data also {}", names.join(", "), scenes.trim_start_matches("use one of "))
        }),
    }
}

/// Evaluates, prints the tables, and writes the files.
pub(crate) fn run(command: &EvalCommand, ui: &mut Ui) -> Result<(), CliError> {
    let (json, report) = match command {
        EvalCommand::Depth(args) => (&args.from.json, depth_of(args, ui)?),
        EvalCommand::Pose(args) => (&args.from.json, pose_of(args, ui)?),
        EvalCommand::Tapvid3d(args) => (&args.from.json, tapvid3d_of(args, ui)?),
        EvalCommand::Trajectories(args) => (&args.from.json, trajectories_of(args, ui)?),
        EvalCommand::Network(args) => (&args.json, network::evaluate(args, ui)?),
        EvalCommand::Efficiency(args) => (&args.json, efficiency::evaluate(args, ui)?),
    };
    tell(json.as_deref(), &report, ui)
}

fn tell(json: Option<&Path>, report: &Report, ui: &mut Ui) -> Result<(), CliError> {
    if let Some(json) = json {
        let written = report.write(json)?;
        let names: Vec<String> = written.iter().map(|path| path.display().to_string()).collect();
        ui.say(&format!("written: {}", names.join(", ")));
    }
    if !report.skipped.is_empty() {
        let zero = report.skipped.iter().filter(|s| s.counts_as_zero).count();
        let rest = report.skipped.len() - zero;
        ui.note(&format!(
            "{rest} sequence(s) have no result, {zero} count as zero: they are named at the end, with the reasons"
        ));
    }
    ui::print(report.to_markdown().trim_end())
}

/// The clips of the paper, in which a network is run.
const CLIPS: ClipRule = ClipRule::Contiguous(CLIP_FRAMES);

/// The one rule by which a network is run.
fn one(rules: &[ClipRule]) -> Result<ClipRule, CliError> {
    match rules {
        [] => Ok(CLIPS),
        [rule] => Ok(*rule),
        _ => Err(CliError::Usage("--data runs the network over clips of one rule: give --clips once".to_owned())),
    }
}

/// The benchmark whose files are read.
fn of_files<T: Copy>(set: Option<Truth<T>>, names: &str) -> Result<T, CliError> {
    match set {
        Some(Truth::Benchmark(set)) => Ok(set),
        Some(Truth::Scenes(set)) => {
            let set = set.name();
            Err(CliError::Usage(format!("--set {set} is for --data; of files --set is one of {names}")))
        }
        None => Err(CliError::Usage(format!("--set says whose layout the truth has: {names}"))),
    }
}

/// The benchmark or scenes of a folder.
fn of_data<T: Copy>(set: Option<Truth<T>>) -> Result<T, Option<Set>> {
    match set {
        Some(Truth::Benchmark(set)) => Ok(set),
        Some(Truth::Scenes(set)) => Err(Some(set)),
        None => Err(None),
    }
}

fn depth_of(args: &DepthArgs, ui: &mut Ui) -> Result<Report, CliError> {
    let of = |align: &Aligned| match align {
        Aligned::Scale => Alignment::Scale,
        Aligned::Median => Alignment::Median,
        Aligned::ScaleShift => Alignment::ScaleShiftAdam,
        Aligned::LeastSquares => Alignment::ScaleShiftLeastSquares,
        Aligned::Metric => Alignment::Metric,
    };
    let asked: Vec<Alignment> = args.align.iter().map(of).collect();
    let alignments = if asked.is_empty() { Alignment::ALL.to_vec() } else { asked };
    match args.from.place() {
        Place::Files { pred, truth } => {
            let set = of_files(args.set, "kitti, sintel, bonn, plain")?;
            let clips = if args.clips.is_empty() { vec![CLIPS, ClipRule::Whole] } else { args.clips.clone() };
            Ok(depth::evaluate(pred, truth, set, &depth::Options { clips, alignments })?)
        }
        Place::Data(folder) => {
            let data = match of_data(args.set) {
                Ok(set) => DepthData::Benchmark(folder, set),
                Err(set) => DepthData::Scenes(SceneData { folder, set }),
            };
            let (rule, most) = (one(&args.clips)?, args.from.most());
            args.from
                .over("depth", ui, |network, progress| run::depth(network, data, rule, &alignments, most, progress))
        }
    }
}

fn pose_of(args: &PoseArgs, ui: &mut Ui) -> Result<Report, CliError> {
    match args.from.place() {
        Place::Files { pred, truth } => {
            let set = of_files(args.set, "sintel, tum, plain")?;
            Ok(pose::evaluate(pred, truth, set, args.clips.unwrap_or(ClipRule::Whole))?)
        }
        Place::Data(folder) => {
            let data = match of_data(args.set) {
                Ok(set) => PoseData::Benchmark(folder, set),
                Err(set) => PoseData::Scenes(SceneData { folder, set }),
            };
            let (rule, most) = (args.clips.unwrap_or(CLIPS), args.from.most());
            args.from.over("pose", ui, |network, progress| run::pose(network, data, rule, most, progress))
        }
    }
}

fn trajectories_of(args: &TrajectoryArgs, ui: &mut Ui) -> Result<Report, CliError> {
    match args.from.place() {
        Place::Files { pred, truth } => Ok(trajectories::evaluate(pred, truth)?),
        Place::Data(folder) => {
            let data = SceneData { folder, set: args.set };
            let (rule, most) = (args.clips.unwrap_or(CLIPS), args.from.most());
            args.from.over("trajectories", ui, |network, progress| {
                run::trajectories(network, data, rule, &args.inputs, most, progress)
            })
        }
    }
}

fn tapvid3d_of(args: &Tapvid3dArgs, ui: &mut Ui) -> Result<Report, CliError> {
    let of = |scaling: &Scaled| match scaling {
        Scaled::Median => Scaling::Median,
        Scaled::Mean => Scaling::Mean,
        Scaled::None => Scaling::None,
        Scaled::PerTrajectory => Scaling::PerTrajectory,
        Scaled::Reproduce2d => Scaling::Reproduce2d,
        Scaled::MedianOnQueries => Scaling::MedianOnQueries,
    };
    let options = |clips: Vec<ClipRule>| -> Result<tapvid3d::Options, CliError> {
        Ok(tapvid3d::Options {
            clips,
            scalings: args.scaling.iter().map(of).collect(),
            thresholds: if args.fixed_thresholds { Thresholds::TAPVID3D_FIXED } else { Thresholds::DepthAdaptive },
            names: args.names.as_deref().map(tapvid3d::read_names).transpose()?,
        })
    };
    match args.from.place() {
        Place::Files { pred, truth } => {
            let clips = if args.clips.is_empty() { vec![ClipRule::Whole, CLIPS] } else { args.clips.clone() };
            Ok(tapvid3d::evaluate(pred, truth, &options(clips)?)?)
        }
        Place::Data(folder) => {
            let options = options(vec![one(&args.clips)?])?;
            if args.from.most().is_some() {
                return Err(CliError::Usage("--most is not for TAPVid-3D: choose with --names".to_owned()));
            }
            args.from.over("tapvid3d", ui, |network, progress| run::tapvid3d(network, folder, &options, progress))
        }
    }
}
