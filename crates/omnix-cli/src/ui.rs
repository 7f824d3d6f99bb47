//! What people see (standard error: bars on a terminal, a line a phase elsewhere) and what machines read (standard output
//! with `--json`: one object a line, with its kind in `event`).

use std::error::Error as _;
use std::io::{IsTerminal as _, Write as _};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use crate::error::CliError;

/// Where words go.
pub(crate) struct Ui {
    json: bool,
    terminal: bool,
    phase: Option<Phase>,
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
    pub(crate) fn new(json: bool) -> Self {
        Self { json, terminal: std::io::stderr().is_terminal(), phase: None }
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

    /// A line for people alone.
    pub(crate) fn say(&self, text: &str) {
        if self.json {
            return;
        }
        match self.phase.as_ref().and_then(|p| p.bar.as_ref()) {
            Some(bar) => bar.suspend(|| eprintln!("{text}")),
            None => eprintln!("{text}"),
        }
    }

    /// A line of machine output, `{"event": name, ...fields}`; nothing without `--json`. A reader that has gone away is no
    /// reason to stop a run that writes files.
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
        let _ = writeln!(out, "{}", Value::Object(object)).and_then(|()| out.flush());
    }

    /// Begins a phase; `text` is its one line where there are no bars.
    pub(crate) fn begin(&mut self, name: &'static str, text: &str) {
        self.end();
        if !self.json && !self.terminal {
            eprintln!("{text}");
        }
        self.phase = Some(Phase { name, since: Instant::now(), bar: None, said: None });
        if !self.json && self.terminal {
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
        eprintln!("error: {message}");
        for cause in &causes {
            eprintln!("  because: {cause}");
        }
        let fields =
            json!({ "kind": error.kind(), "exit_code": error.exit_code(), "message": message, "causes": causes });
        self.event("error", fields);
    }
}

/// Prints the result of a command: text for people, or one JSON value.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{}", text.trim_end()).and_then(|()| out.flush()) {
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        other => other.map_err(CliError::Stdout),
    }
}
