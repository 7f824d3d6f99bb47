//! What people see (standard error: bars on a terminal, a line a phase elsewhere) and what machines read (standard output
//! with `--json`: one object per line, with its kind in `event`).
//!
//! A message that cannot be written (a closed terminal, a full disk under a log) is no failure. An event that cannot is one,
//! unless its reader has gone away: [`Ui::finish`] tells.

use std::error::Error as _;
use std::io::{ErrorKind, IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::error::CliError;
use crate::text;

/// Where words go.
pub(crate) struct Ui {
    json: bool,
    quiet: bool,
    verbose: bool,
    terminal: bool,
    phase: Option<Phase>,
    /// Why the first event that was lost could not be written.
    lost: Option<std::io::Error>,
}

struct Phase {
    name: &'static str,
    since: Instant,
    bar: Option<ProgressBar>,
    said: Option<Instant>,
}

/// Work shorter than this gets no bar.
const LONG: Duration = Duration::from_millis(600);
/// Between two progress events.
const EVERY: Duration = Duration::from_millis(250);

impl Ui {
    pub(crate) fn new(json: bool, quiet: bool, verbose: bool) -> Self {
        Self { json, quiet, verbose, terminal: std::io::stderr().is_terminal(), phase: None, lost: None }
    }

    pub(crate) fn json(&self) -> bool {
        self.json
    }

    /// A remark for people; an event `note` for machines.
    pub(crate) fn note(&mut self, text: &str) {
        if self.json {
            self.event("note", json!({ "message": text }));
        } else {
            self.say(text);
        }
    }

    /// A line for people alone; none with `--quiet`.
    pub(crate) fn say(&self, text: &str) {
        if self.json || self.quiet {
            return;
        }
        match self.phase.as_ref().and_then(|p| p.bar.as_ref()) {
            Some(bar) => bar.suspend(|| to_stderr(text)),
            None => to_stderr(text),
        }
    }

    /// A line for people who asked for more, with `--verbose`.
    pub(crate) fn detail(&self, text: &str) {
        if self.verbose {
            self.say(text);
        }
    }

    /// A line of machine output, `{"event": name, ...fields}`; nothing without `--json`. A reader that has gone away is no
    /// reason to stop a run that writes files, and neither is a full disk: [`Ui::finish`] tells of that.
    pub(crate) fn event(&mut self, name: &str, fields: Value) {
        if !self.json {
            return;
        }
        let mut object = serde_json::Map::new();
        object.insert("event".to_owned(), name.into());
        if let Value::Object(fields) = fields {
            object.extend(fields);
        }
        let mut out = std::io::stdout().lock();
        let written = writeln!(out, "{}", Value::Object(object)).and_then(|()| out.flush());
        if let Err(error) = written
            && error.kind() != ErrorKind::BrokenPipe
        {
            self.lost.get_or_insert(error);
        }
    }

    /// Whether every event reached standard output, or its reader wanted no more.
    pub(crate) fn finish(&mut self) -> Result<(), CliError> {
        self.lost.take().map_or(Ok(()), |error| Err(CliError::Stdout(error)))
    }

    /// Begins a phase; `text` is its one line where there are no bars.
    pub(crate) fn begin(&mut self, name: &'static str, text: &str) {
        self.end();
        if !self.terminal {
            self.say(text);
        }
        self.phase = Some(Phase { name, since: Instant::now(), bar: None, said: None });
        if !self.json && !self.quiet && self.terminal {
            let bar = ProgressBar::new(0);
            bar.set_draw_target(indicatif::ProgressDrawTarget::hidden());
            if let Ok(style) =
                ProgressStyle::with_template("{msg} [{bar:30}] {percent:>3} %, {elapsed} gone, {eta} left")
            {
                bar.set_style(style.progress_chars("=> "));
            }
            bar.set_message(text.to_owned());
            if let Some(phase) = &mut self.phase {
                phase.bar = Some(bar);
            }
        }
    }

    /// Name of the phase that runs.
    pub(crate) fn phase(&self) -> Option<&'static str> {
        self.phase.as_ref().map(|p| p.name)
    }

    /// `done` of `total` units of the phase.
    pub(crate) fn progress(&mut self, done: u64, total: u64) {
        let Some(phase) = &mut self.phase else { return };
        if let Some(bar) = &phase.bar {
            if bar.is_hidden() && phase.since.elapsed() > LONG {
                bar.set_draw_target(indicatif::ProgressDrawTarget::stderr());
            }
            bar.set_length(total);
            bar.set_position(done);
        }
        if self.json && (done == total || phase.said.is_none_or(|at| at.elapsed() >= EVERY)) {
            phase.said = Some(Instant::now());
            let (name, seconds) = (phase.name, phase.since.elapsed().as_secs_f64());
            self.event("progress", json!({ "phase": name, "done": done, "total": total, "seconds": seconds }));
        }
    }

    /// Ends the phase, if one runs, and tells its seconds.
    pub(crate) fn end(&mut self) -> f64 {
        let Some(phase) = self.phase.take() else { return 0.0 };
        if let Some(bar) = phase.bar {
            bar.finish_and_clear();
        }
        phase.since.elapsed().as_secs_f64()
    }

    /// The last word of a failed program: message and causes on standard error, and an event `error` for machines.
    pub(crate) fn error(&mut self, error: &CliError) {
        self.end();
        let (message, causes) = said(error);
        to_stderr(&format!("error: {message}"));
        for cause in &causes {
            to_stderr(&format!("  because: {cause}"));
        }
        if let Some(cure) = error.cure() {
            to_stderr(&format!("  help: {cure}"));
        }
        self.error_event(error);
    }

    /// An event `error` for machines.
    pub(crate) fn error_event(&mut self, error: &CliError) {
        let (message, causes) = said(error);
        let fields = json!({
            "kind": error.kind(), "exit_code": error.exit_code(), "message": message, "causes": causes, "help": error.cure(),
        });
        self.event("error", fields);
    }
}

/// The message of an error, and those of its causes that it does not repeat.
fn said(error: &CliError) -> (String, Vec<String>) {
    let message = error.to_string();
    let mut causes = Vec::new();
    let mut cause = error.source();
    while let Some(source) = cause {
        let text = source.to_string();
        if !message.contains(&text) {
            causes.push(text);
        }
        cause = source.source();
    }
    (message, causes)
}

/// A line on standard error.
pub(crate) fn to_stderr(line: &str) {
    // Whoever closed it, or let its disk run full, does not want to hear of that.
    let _ = writeln!(std::io::stderr().lock(), "{}", text::plain(line));
}

/// Prints the result of a command: text for people, or one JSON value.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text::plain(text.trim_end())).and_then(|()| out.flush()) {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(CliError::Stdout),
    }
}
