//! One file a command.

pub(crate) mod bench;
pub(crate) mod devices;
pub(crate) mod plan;
pub(crate) mod query;
pub(crate) mod reconstruct;
pub(crate) mod weights;

use crate::args::Command;
use crate::error::CliError;
use crate::ui::Ui;

/// Runs a command.
pub(crate) fn run(command: Command, ui: &mut Ui) -> Result<(), CliError> {
    match command {
        Command::Reconstruct(args) => reconstruct::run(&args, ui),
        Command::Query(args) => query::run(&args, ui),
        Command::Plan(args) => plan::run(&args, ui),
        Command::Devices(args) => devices::run(&args, ui),
        Command::Weights(command) => weights::run(&command, ui),
        Command::Bench(args) => bench::run(&args, ui),
    }
}
