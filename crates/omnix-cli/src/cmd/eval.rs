//! `omnix eval`: predictions against truth, by the numbers of papers.

mod efficiency;
mod network;

use std::path::{Path, PathBuf};

use clap::{Args, Subcommand, ValueEnum};
use omnix_eval::clips::ClipRule;
use omnix_eval::depth::Alignment;
use omnix_eval::kinds::depth::{self, DepthSet};
use omnix_eval::kinds::pose::{self, PoseSet};
use omnix_eval::kinds::{tapvid3d, trajectories};
use omnix_eval::table::Report;
use omnix_eval::tracks::Thresholds;
use omnix_eval::tracks::tapvid3d::Scaling;

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
    /// Trajectories of all pixels, from runs with `--export tracks --all-tracks`: APD3D and EPE of the first image and of all, of what moves
    /// and of everything.
    Trajectories(Files),
    /// A network on samples with known depth, cameras and motion, made from a seed or read from a data set: each figure apart, beside the
    /// trivial answers. Opens a device.
    Network(network::NetworkArgs),
    /// What a network costs: parameters, operations counted both ways, planned and measured memory, time. Opens a device.
    Efficiency(efficiency::EfficiencyArgs),
}

/// Where predictions and truth lie, and where the result goes.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct Files {
    /// Folder of predictions, named as the sequences of the truth.
    #[arg(long, value_name = "PATH")]
    pred: PathBuf,
    /// Folder of the truth.
    #[arg(long, value_name = "PATH")]
    truth: PathBuf,
    /// Write the result to this file, and beside it as Markdown (.md) and plots (.svg).
    #[arg(long, value_name = "FILE")]
    json: Option<PathBuf>,
}

/// Arguments of `omnix eval depth`.
#[derive(Debug, Args)]
pub(crate) struct DepthArgs {
    #[command(flatten)]
    files: Files,
    /// Whose layout and protocol the truth has.
    #[arg(long, value_name = "SET")]
    set: Depths,
    /// Frames evaluated together: whole, contiguous:N or uniform:N; may be given again, the first is quoted.
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse, default_values = ["contiguous:16", "whole"])]
    clips: Vec<ClipRule>,
    /// How predictions are brought onto the truth; may be given again, the first is quoted. [default: all, scale first]
    #[arg(long, value_name = "HOW")]
    align: Vec<Aligned>,
}

/// Arguments of `omnix eval pose`.
#[derive(Debug, Args)]
pub(crate) struct PoseArgs {
    #[command(flatten)]
    files: Files,
    /// Whose layout and protocol the truth has.
    #[arg(long, value_name = "SET")]
    set: Poses,
    /// Poses evaluated together: whole, contiguous:N or uniform:N.
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse, default_value = "whole")]
    clips: ClipRule,
}

/// Arguments of `omnix eval tapvid3d`.
#[derive(Debug, Args)]
pub(crate) struct Tapvid3dArgs {
    #[command(flatten)]
    files: Files,
    /// Text file with the names to evaluate, one a line, such as those of minival. [default: all files of the truth]
    #[arg(long, value_name = "FILE")]
    names: Option<PathBuf>,
    /// Frames evaluated together: whole, contiguous:N or uniform:N; may be given again, the first is quoted.
    #[arg(long, value_name = "RULE", value_parser = ClipRule::parse, default_values = ["whole", "contiguous:16"])]
    clips: Vec<ClipRule>,
    /// How predictions are scaled; may be given again, the first is quoted.
    #[arg(long, value_name = "HOW", default_values = ["median"])]
    scaling: Vec<Scaled>,
    /// Fixed distances of 1 cm to 2.56 m instead of those of 1 to 16 pixels at the true depth.
    #[arg(long)]
    fixed_thresholds: bool,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Depths {
    /// Annotated depth; 16-bit PNG.
    Kitti,
    /// `.dpt`, up to 70 m.
    Sintel,
    /// 16-bit PNG, up to 70 m.
    Bonn,
    /// Arrays, in the layouts of predictions.
    Plain,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum Poses {
    /// `.cam`, positions relative to their mean.
    Sintel,
    /// rgb.txt and groundtruth.txt; every third match, the first 90.
    Tum,
    /// NAME.txt or NAME.tum.
    Plain,
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

/// Evaluates, prints the tables, and writes the files.
pub(crate) fn run(command: &EvalCommand, ui: &mut Ui) -> Result<(), CliError> {
    let (json, report) = match command {
        EvalCommand::Depth(args) => (&args.files.json, depth_of(args)?),
        EvalCommand::Pose(args) => {
            let set = match args.set {
                Poses::Sintel => PoseSet::Sintel,
                Poses::Tum => PoseSet::Tum,
                Poses::Plain => PoseSet::Plain,
            };
            (&args.files.json, pose::evaluate(&args.files.pred, &args.files.truth, set, args.clips)?)
        }
        EvalCommand::Tapvid3d(args) => (&args.files.json, tapvid3d_of(args)?),
        EvalCommand::Trajectories(files) => (&files.json, trajectories::evaluate(&files.pred, &files.truth)?),
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

fn depth_of(args: &DepthArgs) -> Result<Report, CliError> {
    let set = match args.set {
        Depths::Kitti => DepthSet::Kitti,
        Depths::Sintel => DepthSet::Sintel,
        Depths::Bonn => DepthSet::Bonn,
        Depths::Plain => DepthSet::Plain,
    };
    let of = |align: &Aligned| match align {
        Aligned::Scale => Alignment::Scale,
        Aligned::Median => Alignment::Median,
        Aligned::ScaleShift => Alignment::ScaleShiftAdam,
        Aligned::LeastSquares => Alignment::ScaleShiftLeastSquares,
        Aligned::Metric => Alignment::Metric,
    };
    let asked: Vec<Alignment> = args.align.iter().map(of).collect();
    let alignments = if asked.is_empty() { Alignment::ALL.to_vec() } else { asked };
    let options = depth::Options { clips: args.clips.clone(), alignments };
    Ok(depth::evaluate(&args.files.pred, &args.files.truth, set, &options)?)
}

fn tapvid3d_of(args: &Tapvid3dArgs) -> Result<Report, CliError> {
    let of = |scaling: &Scaled| match scaling {
        Scaled::Median => Scaling::Median,
        Scaled::Mean => Scaling::Mean,
        Scaled::None => Scaling::None,
        Scaled::PerTrajectory => Scaling::PerTrajectory,
        Scaled::Reproduce2d => Scaling::Reproduce2d,
        Scaled::MedianOnQueries => Scaling::MedianOnQueries,
    };
    let options = tapvid3d::Options {
        clips: args.clips.clone(),
        scalings: args.scaling.iter().map(of).collect(),
        thresholds: if args.fixed_thresholds { Thresholds::TAPVID3D_FIXED } else { Thresholds::DepthAdaptive },
        names: args.names.as_deref().map(tapvid3d::read_names).transpose()?,
    };
    Ok(tapvid3d::evaluate(&args.files.pred, &args.files.truth, &options)?)
}
