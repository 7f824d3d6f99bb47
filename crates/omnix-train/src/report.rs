//! What a run tells while it goes on: figures as JSON lines, event files of TensorBoard, and a page with curves.
//!
//! ```text
//! OUT/train.jsonl     {"kind":"step","step":K,"loss":..,"terms":{..},"norm":..,"rates":[..],"seconds":..,"time":..}
//!                     {"kind":"validation","step":K,"loss":..,"terms":{..},"figures":{..},"time":..}
//! OUT/events.out.tfevents.SECONDS.STEP.omnix      the same numbers; one file for each start of the program
//! OUT/train.html      curves; written anew every so often
//! ```
//!
//! `step` is the number of steps done, `seconds` the step's own time, `time` seconds since 1970. A run that is continued from step K
//! first takes out the lines of later steps, which a killed program wrote after its last checkpoint.

mod curve;
mod events;
mod page;

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use omnix_tensors::AtomicFile;
use serde_json::{Map, Value, json};

use crate::TrainError;
use crate::interface::LossValues;
use curve::Curve;
use events::EventFile;
use page::{Diagram, page};

/// Name of the file of lines.
pub const LINES: &str = "train.jsonl";
/// Name of the page.
pub const PAGE: &str = "train.html";

/// A step as it is reported.
#[derive(Debug, Clone, PartialEq)]
pub struct StepFigures {
    /// Steps done, this one included.
    pub step: u64,
    /// The mean over its samples.
    pub losses: LossValues,
    /// Norm of the gradient before the clip.
    pub norm: f64,
    /// Rate of each group.
    pub rates: Vec<f64>,
    /// Seconds that it took.
    pub seconds: f64,
}

/// The reports of a run.
pub struct Report {
    out: PathBuf,
    title: String,
    settings: String,
    groups: Vec<String>,
    lines: File,
    events: EventFile,
    /// By what they show: `loss`, `validation loss`, `NAME`, `validation NAME`, `norm`, `rate GROUP`, `seconds`.
    curves: BTreeMap<String, Curve>,
    terms: Vec<String>,
}

fn now() -> f64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0.0, |since| since.as_secs_f64())
}

fn failed(path: &Path) -> impl FnOnce(std::io::Error) -> TrainError {
    let path = path.to_owned();
    move |source| TrainError::Write { path, source }
}

impl Report {
    /// Begins the reports of a run in its folder, or goes on with them after `step` steps. `groups` are the groups' names.
    ///
    /// # Errors
    /// Files that cannot be read or written.
    pub fn open(out: &Path, step: u64, title: &str, settings: &Value, groups: &[String]) -> Result<Self, TrainError> {
        let path = out.join(LINES);
        let mut curves = BTreeMap::new();
        let mut terms = Vec::new();
        keep_lines(&path, step, &mut |line| draw(&mut curves, &mut terms, groups, line))?;
        let lines = OpenOptions::new().append(true).create(true).open(&path).map_err(failed(&path))?;
        let time = now();
        let path = out.join(format!("events.out.tfevents.{}.{step}.omnix", time as u64));
        let events = EventFile::create(&path, time, step + 1).map_err(failed(&path))?;
        let (out, title, settings) = (out.to_owned(), title.to_owned(), format!("{settings:#}"));
        Ok(Self { out, title, settings, groups: groups.to_vec(), lines, events, curves, terms })
    }

    /// Reports a step.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn step(&mut self, figures: &StepFigures) -> Result<(), TrainError> {
        let StepFigures { step, losses, norm, rates, seconds } = figures;
        let mut line = of_losses("step", *step, losses);
        line.insert("norm".to_owned(), json!(norm));
        line.insert("rates".to_owned(), json!(rates));
        line.insert("seconds".to_owned(), json!(seconds));
        self.line(*step, line)
    }

    /// Reports a validation; `figures` by name.
    ///
    /// # Errors
    /// Files that cannot be written.
    pub fn validation(
        &mut self,
        step: u64,
        losses: &LossValues,
        figures: &[(&'static str, f64)],
    ) -> Result<(), TrainError> {
        let mut line = of_losses("validation", step, losses);
        let figures: Map<String, Value> =
            figures.iter().map(|(name, value)| ((*name).to_owned(), json!(value))).collect();
        line.insert("figures".to_owned(), Value::Object(figures));
        self.line(step, line)
    }

    fn line(&mut self, step: u64, mut line: Map<String, Value>) -> Result<(), TrainError> {
        let time = now();
        line.insert("time".to_owned(), json!(time));
        let line = Value::Object(line);
        let drawn = draw(&mut self.curves, &mut self.terms, &self.groups, &line);
        // One write, so that a program that is killed leaves at most one line cut short.
        let written = self.lines.write_all(format!("{line}\n").as_bytes());
        written.map_err(failed(&self.out.join(LINES)))?;
        self.events.scalars(time, step, &drawn).map_err(failed(&self.out))
    }

    /// Writes the page; `facts` stand on top of it.
    ///
    /// # Errors
    /// The page cannot be written.
    pub fn page(&self, facts: &[(&str, String)]) -> Result<(), TrainError> {
        let curve = |name: &str| self.curves.get(name);
        let pair = |name: &str| {
            let both = [("training", curve(name)), ("validation", curve(&format!("validation {name}")))];
            both.into_iter().filter_map(|(label, curve)| Some((label, curve?))).collect::<Vec<_>>()
        };
        let mut diagrams = vec![Diagram { title: "loss", curves: pair("loss") }];
        diagrams.extend(self.terms.iter().map(|term| Diagram { title: term, curves: pair(term) }));
        let named = |title, names: Vec<String>| {
            let curves = names.iter().filter_map(|name| self.curves.get_key_value(name));
            Diagram { title, curves: curves.map(|(name, curve)| (name.as_str(), curve)).collect() }
        };
        diagrams.push(named("norm of the gradient before the clip", vec!["norm".to_owned()]));
        diagrams.push(named("rates", (0..self.groups.len()).map(|i| rate_of(&self.groups, i)).collect()));
        diagrams.push(named("seconds per step", vec!["seconds".to_owned()]));
        let (path, text) = (self.out.join(PAGE), page(&self.title, facts, &diagrams, &self.settings));
        let write = || {
            let mut file = AtomicFile::create(&path)?;
            file.write_all(text.as_bytes())?;
            file.commit()
        };
        write().map(|_| ()).map_err(failed(&path))
    }
}

fn rate_of(groups: &[String], index: usize) -> String {
    match groups.get(index).map(String::as_str) {
        None | Some("") => "rate of the rest".to_owned(),
        Some(name) => format!("rate of {name}"),
    }
}

fn of_losses(kind: &str, step: u64, losses: &LossValues) -> Map<String, Value> {
    let terms: Map<String, Value> = losses.terms.iter().map(|(name, value)| (name.clone(), json!(value))).collect();
    let pairs = [("kind", json!(kind)), ("step", json!(step)), ("loss", json!(losses.total)), ("terms", json!(terms))];
    pairs.into_iter().map(|(name, value)| (name.to_owned(), value)).collect()
}

/// Adds a line's numbers to the curves; the numbers with the names that TensorBoard shows.
fn draw(
    curves: &mut BTreeMap<String, Curve>,
    terms: &mut Vec<String>,
    groups: &[String],
    line: &Value,
) -> Vec<(String, f64)> {
    let Some(step) = line.get("step").and_then(Value::as_u64) else { return Vec::new() };
    let validation = line.get("kind").and_then(Value::as_str) == Some("validation");
    let (prefix, tab) = if validation { ("validation ", "validation") } else { ("", "train") };
    let mut numbers = Vec::new();
    let mut add = |curve: String, tag: String, value: Option<&Value>| {
        if let Some(value) = value.and_then(Value::as_f64) {
            curves.entry(curve).or_default().push(step, value);
            numbers.push((tag, value));
        }
    };
    add(format!("{prefix}loss"), format!("{tab}/loss"), line.get("loss"));
    let table = |name: &str| line.get(name).and_then(Value::as_object).into_iter().flatten();
    // A figure may have the name of a term: both have a displacement.
    let figures = table("figures").map(|(name, value)| (format!("figure {name}"), value));
    for (name, value) in table("terms").map(|(name, value)| (name.clone(), value)).chain(figures) {
        if !terms.contains(&name) {
            terms.push(name.clone());
        }
        add(format!("{prefix}{name}"), format!("{tab}/{}", name.replace(' ', "/")), Some(value));
    }
    for name in ["norm", "seconds"] {
        add(name.to_owned(), format!("step/{name}"), line.get(name));
    }
    for (index, rate) in line.get("rates").and_then(Value::as_array).into_iter().flatten().enumerate() {
        let name = rate_of(groups, index);
        add(name.clone(), format!("step/{}", name.replace(' ', "_")), Some(rate));
    }
    numbers
}

/// Takes lines of steps after `step`, and what is no line, out of a file; shows the others to `each`.
fn keep_lines(path: &Path, step: u64, each: &mut dyn FnMut(&Value) -> Vec<(String, f64)>) -> Result<(), TrainError> {
    if !path.exists() {
        return Ok(());
    }
    let mut rewrite = || {
        let mut kept = AtomicFile::create(path)?;
        for line in BufReader::new(File::open(path)?).split(b'\n') {
            let line = line?;
            let Ok(value) = serde_json::from_slice::<Value>(&line) else { continue };
            if value.get("step").and_then(Value::as_u64).is_some_and(|of| of <= step) {
                kept.write_all(&line)?;
                kept.write_all(b"\n")?;
                each(&value);
            }
        }
        kept.commit()
    };
    rewrite().map(|_| ()).map_err(failed(path))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn figures(step: u64) -> StepFigures {
        let losses =
            LossValues { total: 1.0 / step as f64, terms: vec![("depth".to_owned(), 0.5), ("ray".to_owned(), 0.25)] };
        StepFigures { step, losses, norm: 2.0, rates: vec![1e-4, 0.0], seconds: 0.1 }
    }

    fn steps(out: &Path) -> Vec<u64> {
        let text = std::fs::read_to_string(out.join(LINES)).unwrap();
        let line = |line: &str| serde_json::from_str::<Value>(line).unwrap()["step"].as_u64().unwrap();
        text.lines().map(line).collect()
    }

    #[test]
    fn a_continued_run_has_the_lines_of_one_that_was_never_killed() {
        let dir = tempfile::tempdir().unwrap();
        let groups = ["backbone".to_owned(), String::new()];
        let open = |step| Report::open(dir.path(), step, "nano", &json!({"seed": 1}), &groups).unwrap();
        let mut report = open(0);
        (1..=5).for_each(|step| report.step(&figures(step)).unwrap());
        report.validation(5, &figures(5).losses, &[("AbsRel", 0.125)]).unwrap();
        // Killed in the middle of a line; the checkpoint is of step 3.
        write!(report.lines, "{{\"kind\":\"st").unwrap();
        drop(report);
        let mut report = open(3);
        (4..=6).for_each(|step| report.step(&figures(step)).unwrap());
        report.validation(6, &figures(6).losses, &[("AbsRel", 0.25)]).unwrap();
        assert_eq!(report.curves["validation figure AbsRel"].points().len(), 1);
        assert_eq!(steps(dir.path()), [1, 2, 3, 4, 5, 6, 6]);
        assert_eq!(report.curves["loss"].points().len(), 6);
        report.page(&[("step", "6 of 20".to_owned())]).unwrap();
        let page = std::fs::read_to_string(dir.path().join(PAGE)).unwrap();
        for shown in [
            "rate of backbone",
            "rate of the rest",
            "depth",
            "figure AbsRel",
            "validation",
            "6 of 20",
            "&quot;seed&quot;: 1",
        ] {
            assert!(page.contains(shown), "{shown}");
        }
        let events = std::fs::read_dir(dir.path()).unwrap().flatten();
        let names: Vec<_> = events.map(|entry| entry.file_name().into_string().unwrap()).collect();
        assert_eq!(names.iter().filter(|name| name.starts_with("events.out.tfevents.")).count(), 2, "{names:?}");
    }
}
