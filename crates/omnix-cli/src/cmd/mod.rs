//! The command line: one file per command, and the choice among them.

pub(crate) mod bench;
pub(crate) mod completions;
pub(crate) mod data;
pub(crate) mod devices;
pub(crate) mod eval;
pub(crate) mod plan;
pub(crate) mod query;
pub(crate) mod reconstruct;
pub(crate) mod render;
pub(crate) mod scenes;
pub(crate) mod train;
pub(crate) mod weights;

use clap::{CommandFactory as _, Parser, Subcommand};

use crate::error::{CliError, EXIT_CODES};
use crate::ui::Ui;

/// Any-view, any-time reconstruction on any GPU: depth, cameras and moving points from images and videos of a scene.
#[derive(Debug, Parser)]
#[command(name = "omnix", version, after_help = EXIT_CODES, arg_required_else_help = true)]
pub(crate) struct Cli {
    /// Say nothing but errors.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Say more: the plan of a run, and what the libraries log.
    #[arg(short, long, global = true)]
    pub(crate) verbose: bool,
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Depth, cameras and moving points of images, folders and videos, written to a folder.
    Reconstruct(reconstruct::ReconstructArgs),
    /// Paths of points from a saved field: of one image, the pixels and times asked for.
    Query(query::QueryArgs),
    /// Pictures and films of a run's points, with trails and cameras, from any view and at any time.
    Render(render::RenderArgs),
    /// What a run would take: memory, operations, chunks and files. Needs no GPU.
    Plan(plan::PlanArgs),
    /// Trains a network on made scenes, with gradients, optimiser and checkpoints of this program's own.
    Train(train::TrainArgs),
    /// The devices of this machine: which will do, which not, and why.
    Devices(devices::DevicesArgs),
    /// Predictions against truth, by the numbers of papers: depth, camera poses, point tracks. Needs no GPU.
    #[command(subcommand)]
    Eval(eval::EvalCommand),
    /// Makes dynamic scenes from a seed: pictures with exact depth, cameras, masks and meshes. Needs no GPU.
    Scenes(scenes::ScenesArgs),
    /// Looks into checkpoints.
    #[command(subcommand)]
    Weights(weights::WeightsCommand),
    /// Looks into data sets for training and evaluation.
    #[command(subcommand)]
    Data(data::DataCommand),
    /// Completions of commands and options for a shell, on standard output.
    Completions(completions::CompletionsArgs),
    /// Times the kernels and the small network, beside what the device can do at best.
    Bench(bench::BenchArgs),
}

impl Command {
    /// Whether machines listen.
    pub(crate) fn json(&self) -> bool {
        match self {
            Self::Reconstruct(args) => args.run.json,
            Self::Query(args) => args.json,
            Self::Render(args) => args.json,
            Self::Plan(args) => args.run.json,
            Self::Train(args) => args.json,
            Self::Devices(args) => args.json,
            Self::Scenes(args) => args.json,
            Self::Weights(command) => command.json(),
            Self::Data(command) => command.json(),
            // Its `--json` names a file.
            Self::Completions(_) | Self::Eval(_) => false,
            Self::Bench(args) => args.json,
        }
    }
}

/// Runs a command.
pub(crate) fn run(command: Command, ui: &mut Ui) -> Result<(), CliError> {
    match command {
        Command::Reconstruct(args) => reconstruct::run(&args, ui),
        Command::Query(args) => query::run(&args, ui),
        Command::Render(args) => render::run(&args, ui),
        Command::Plan(args) => plan::run(&args, ui),
        Command::Train(args) => train::run(&args, ui),
        Command::Devices(args) => devices::run(&args, ui),
        Command::Eval(command) => eval::run(&command, ui),
        Command::Scenes(args) => scenes::run(&args, ui),
        Command::Weights(command) => weights::run(&command, ui),
        Command::Data(command) => data::run(&command, ui),
        Command::Completions(args) => completions::run(&args, Cli::command()),
        Command::Bench(args) => bench::run(&args, ui),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
