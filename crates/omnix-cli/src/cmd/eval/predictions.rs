//! Where predictions come from: files, or a network that is run over a data set.

use std::path::{Path, PathBuf};

use clap::Args;
use omnix_eval::EvalError;
use omnix_eval::run::{Network, Progress};
use omnix_eval::table::Report;

use super::runner::Runner;
use crate::args::{self, DeviceArgs};
use crate::error::CliError;
use crate::ui::Ui;

const FILES: &str = "Predictions from files";
const RUN: &str = "A network over a data set";

/// The two forms of every kind: `--pred PATH --truth PATH`, or `--data DIR --weights W`.
#[derive(Debug, Args)]
pub(crate) struct Predictions {
    /// Folder of predictions, named as the sequences of the truth.
    #[arg(long, value_name = "PATH", requires = "truth", required_unless_present = "data", conflicts_with = "data", help_heading = FILES)]
    pred: Option<PathBuf>,
    /// Folder of the truth.
    #[arg(long, value_name = "PATH", requires = "pred", conflicts_with = "data", help_heading = FILES)]
    truth: Option<PathBuf>,
    /// Run a network over this data set, clip by clip, and evaluate what it says. Opens a device.
    #[arg(long, value_name = "DIR", help_heading = RUN)]
    data: Option<PathBuf>,
    /// Checkpoint: a folder with config.json and model.safetensors, such a file, or `nano`.
    #[arg(long, value_name = "PATH|NAME", default_value = "nano", help_heading = RUN)]
    weights: String,
    /// Size of the network's pictures, multiples of 14. [default: about 504x280 in the shape of the clip's first picture; for nano about
    /// 140x84]
    #[arg(long, value_name = "WxH", value_parser = args::size, requires = "data", help_heading = RUN)]
    size: Option<(u32, u32)>,
    /// Run at most N sequences, evenly spread over the data set. [default: all]
    #[arg(long, value_name = "N", requires = "data", value_parser = clap::value_parser!(u32).range(1..), help_heading = RUN)]
    most: Option<u32>,
    #[command(flatten)]
    device: DeviceArgs,
    /// Write the result to this file, and beside it as Markdown (.md) and plots (.svg).
    #[arg(long, value_name = "FILE")]
    pub(super) json: Option<PathBuf>,
}

/// What was asked for.
pub(super) enum Place<'a> {
    /// Predictions and truth.
    Files { pred: &'a Path, truth: &'a Path },
    /// A data set.
    Data(&'a Path),
}

impl Predictions {
    /// Which of the two forms.
    pub(super) fn place(&self) -> Place<'_> {
        match (&self.pred, &self.truth, &self.data) {
            (Some(pred), Some(truth), _) => Place::Files { pred, truth },
            // One of the two forms is there, or the program ends with its usage.
            (_, _, data) => Place::Data(data.as_deref().unwrap_or(Path::new("."))),
        }
    }

    /// Sequences that are run, at most.
    pub(super) fn most(&self) -> Option<usize> {
        self.most.map(|most| most as usize)
    }

    /// Opens the network and runs an evaluation with it.
    pub(super) fn over(
        &self,
        kind: &'static str,
        ui: &mut Ui,
        evaluate: impl FnOnce(&mut dyn Network, &mut Progress<'_>) -> Result<Report, EvalError>,
    ) -> Result<Report, CliError> {
        let mut runner = Runner::open(&self.weights, self.size, &self.device, kind != "depth")?;
        ui.begin(kind, &format!("{} over {}", self.weights, self.place_of_data().display()));
        let report = evaluate(&mut runner, &mut |done, of| ui.progress(done, of));
        ui.end();
        Ok(report?)
    }

    fn place_of_data(&self) -> &Path {
        self.data.as_deref().unwrap_or(Path::new("."))
    }
}
