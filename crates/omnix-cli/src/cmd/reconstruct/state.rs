//! Where a run stands: what was asked, what is open, what was written. It outlives a failure of the run, so that what was
//! finished can be completed and described.

use std::path::{Path, PathBuf};

use omnix::io::output::OutputFolder;
use omnix::io::output::manifest::WrittenFile;
use omnix::io::{RunSummary, Sink};
use omnix::{Camera, DeviceInfo};
use serde_json::{Map, Value, json};

use crate::args::RunArgs;
use crate::error::CliError;
use crate::job::Job;
use crate::ui::Ui;

/// Where a run stands; survives its failure.
pub(super) struct Run<'a> {
    pub(super) job: &'a Job,
    /// The inputs as given.
    pub(super) inputs: &'a [PathBuf],
    /// The output folder.
    pub(super) dir: &'a Path,
    /// The same, held against other runs.
    pub(super) folder: OutputFolder,
    /// Whether anything in it is this run's.
    pub(super) begun: bool,
    /// Files of earlier runs in it.
    pub(super) earlier: Vec<String>,
    pub(super) args: &'a RunArgs,
    pub(super) info: DeviceInfo,
    /// Bytes on the device at most, as planned.
    pub(super) planned: u64,
    pub(super) sinks: Vec<Box<dyn Sink>>,
    pub(super) finished: usize,
    /// What the exports show, where it is not the camera decoder's.
    pub(super) cameras: Vec<Camera>,
    /// Files that were written.
    pub(super) files: Vec<WrittenFile>,
    /// What the manifest says of a film's windows.
    pub(super) windows: Value,
    /// Windows of a film that are finished, and all of them, while they are computed.
    pub(super) computing: Option<(usize, usize)>,
    /// What the manifest says of motion.
    pub(super) motion: Value,
    pub(super) timings: Map<String, Value>,
}

impl Run<'_> {
    /// Notes files that were written, with trajectories or without.
    pub(super) fn wrote(&mut self, files: impl IntoIterator<Item = PathBuf>, moving: bool) {
        self.files.extend(files.into_iter().map(|path| WrittenFile { path, moving }));
    }

    /// What a user should know of files that an earlier run left in the folder.
    pub(super) fn earlier_note(&self) -> Option<String> {
        let (first, last) = (self.earlier.first()?, self.earlier.last()?);
        Some(match self.earlier.len() {
            1 => format!("1 file of an earlier run is still in the output folder: {first}"),
            2 => format!("2 files of an earlier run are still in the output folder: {first} and {last}"),
            n => format!("{n} files of an earlier run are still in the output folder: {first} to {last}"),
        })
    }

    /// Completes the sinks' files; on failure tries all of it and returns the first error.
    pub(super) fn close_sinks(&mut self, interrupted: bool) -> Result<(), CliError> {
        let mut failed = None;
        for sink in std::mem::take(&mut self.sinks) {
            match sink.finish(&RunSummary { interrupted }) {
                Ok(written) => self.wrote(written, false),
                Err(error) => failed = failed.or(Some(error)),
            }
        }
        failed.map_or(Ok(()), |error| Err(error.into()))
    }
}

/// Ends the phase that runs, adds its seconds to its name's, and begins `name`, unless that is empty.
pub(super) fn begin(timings: &mut Map<String, Value>, ui: &mut Ui, name: &'static str, text: &str) {
    if let Some(before) = ui.phase() {
        let seconds = timings.get(before).and_then(Value::as_f64).unwrap_or(0.0) + ui.end();
        timings.insert(before.to_owned(), json!(seconds));
    }
    if !name.is_empty() {
        ui.begin(name, text);
    }
}
