//! `omnix data check`: whether ground truth agrees with itself.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::{Args, Subcommand};
use omnix_data::check::{self, CheckOptions, SceneReport};
use omnix_data::{DataError, Overview, Set, sets, sheet};
use serde_json::{Value, json};

use crate::error::CliError;
use crate::stop;
use crate::ui::{self, Ui};

/// What to do with a data set.
#[derive(Debug, Subcommand)]
pub(crate) enum DataCommand {
    /// Measures a data set: depth between views, paths, visibility; says what is wrong with its cameras. Exit code 3 if anything is.
    Check(CheckArgs),
}

/// Arguments of `data check`.
#[derive(Debug, Args)]
pub(crate) struct CheckArgs {
    /// A scene, or a folder with scenes in it: of a known data set, in the shared layout, or of `omnix reconstruct`.
    #[arg(value_name = "DIR")]
    folder: PathBuf,
    /// The data set, where more than one would fit: ue, pointodyssey, waymo, omnigame, dynamic-replica, dl3dv, stereo4d, spring,
    /// hoi4d, droid, shared, output.
    #[arg(long, value_name = "NAME", value_parser = set_of)]
    set: Option<Set>,
    /// Images of each scene that are looked at, at most.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u16).range(1..=256))]
    images: u16,
    /// Writes a contact sheet of each scene into this folder, a page of them, index.html, and overview.png: up to 24 scenes, of each a
    /// picture over its depth.
    #[arg(long, value_name = "DIR")]
    sheets: Option<PathBuf>,
    /// One JSON object per scene on standard output, and one with the totals.
    #[arg(long)]
    json: bool,
}

impl DataCommand {
    /// Whether machines listen.
    pub(crate) fn json(&self) -> bool {
        match self {
            Self::Check(args) => args.json,
        }
    }
}

pub(crate) fn set_of(name: &str) -> Result<Set, String> {
    Set::of_name(name).ok_or_else(|| {
        let names: Vec<&str> = Set::ALL.iter().map(|set| set.name()).collect();
        format!("use one of {}", names.join(", "))
    })
}

/// Runs the command.
pub(crate) fn run(command: &DataCommand, ui: &mut Ui) -> Result<(), CliError> {
    match command {
        DataCommand::Check(args) => check_all(args, ui),
    }
}

/// What became of the scenes.
#[derive(Default)]
struct Totals {
    good: usize,
    wrong: usize,
    unreadable: usize,
    kinds: BTreeMap<&'static str, usize>,
    pages: Vec<(SceneReport, Option<String>)>,
    overview: Overview,
}

fn check_all(args: &CheckArgs, ui: &mut Ui) -> Result<(), CliError> {
    let scenes = sets::find(&args.folder, args.set)?;
    stop::keep_results();
    let mut totals = Totals::default();
    ui.begin("check", &format!("{} scene(s)", scenes.len()));
    for (index, folder) in scenes.iter().enumerate() {
        if stop::asked() {
            break;
        }
        match check_one(folder, index, args, &mut totals.overview) {
            Ok(done) => tell(done, &mut totals, ui)?,
            // With one scene, its error is that of the command.
            Err(error) if scenes.len() == 1 => return Err(error.into()),
            Err(error @ DataError::Write { .. }) => return Err(error.into()),
            Err(error) => {
                totals.unreadable += 1;
                let path = folder.to_string_lossy();
                ui.event("unreadable", json!({ "path": path, "message": error.to_string() }));
                ui.say(&format!("{path}: cannot be read: {error}"));
            }
        }
        ui.progress(index as u64 + 1, scenes.len() as u64);
    }
    ui.end();
    if let Some(sheets) = &args.sheets {
        check::write_page(&totals.pages, &sheets.join("index.html"))?;
        if let Some(overview) = totals.overview.picture() {
            check::write_sheet(&overview, &sheets.join("overview.png"))?;
        }
    }
    let Totals { good, wrong, unreadable, kinds, .. } = totals;
    let looked_at = good + wrong + unreadable;
    let fields = json!({
        "scenes": scenes.len(), "looked_at": looked_at, "good": good, "wrong": wrong, "unreadable": unreadable, "problems": kinds,
    });
    ui.event("check", fields);
    ui.say(&format!("{good} of {looked_at} scene(s) without a problem, {unreadable} could not be read"));
    if stop::asked() {
        return Err(CliError::CheckInterrupted { looked_at, scenes: scenes.len() });
    }
    if wrong + unreadable > 0 {
        return Err(CliError::BadData { scenes: wrong + unreadable, path: args.folder.clone() });
    }
    Ok(())
}

/// Checks one scene, and draws its sheet if asked to.
fn check_one(
    folder: &Path,
    index: usize,
    args: &CheckArgs,
    overview: &mut Overview,
) -> Result<(SceneReport, Option<String>), DataError> {
    let scene = sets::open(folder, args.set)?;
    let options = CheckOptions { images: usize::from(args.images), ..CheckOptions::default() };
    let (sample, report) = check::check_scene(scene.as_ref(), &options)?;
    let Some(sheets) = &args.sheets else {
        return Ok((report, None));
    };
    overview.add(&sample);
    let name = format!("{index:05}.png");
    check::write_sheet(&sheet(&sample), &sheets.join(&name))?;
    Ok((report, Some(name)))
}

fn tell(done: (SceneReport, Option<String>), totals: &mut Totals, ui: &mut Ui) -> Result<(), CliError> {
    let (report, name) = &done;
    *if report.problems.is_empty() { &mut totals.good } else { &mut totals.wrong } += 1;
    for problem in &report.problems {
        *totals.kinds.entry(problem.kind).or_default() += 1;
    }
    if ui.json() {
        let mut fields = serde_json::to_value(report).unwrap_or(Value::Null);
        fields["sheet"] = json!(name);
        ui.event("scene", fields);
    } else {
        ui::print(&check::lines(report))?;
    }
    if name.is_some() {
        totals.pages.push(done);
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_is_named_in_the_help() {
        let mut command = CheckArgs::augment_args(clap::Command::new("check"));
        let help = command.render_long_help().to_string();
        for set in Set::ALL {
            assert!(help.contains(set.name()), "{}", set.name());
            assert_eq!(set_of(set.name()), Ok(set));
        }
        assert!(set_of("kitti").is_err());
    }
}
