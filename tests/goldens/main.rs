//! The networks against recorded cases of the reference implementations, one line per case folder: its worst relative error, pass or
//! fail. And the numbers of papers against those of published code, one line per case. The program exits with 1 if any line fails.
//!
//! Folders: the small copies in `tests/data/goldens`, everything in `../shared/golden` when it is there, and every
//! case folder of the folders listed in `OMNIX_GOLDEN` (colon-separated).

mod case;
mod collect;
mod eval;
mod gaussians;
mod geometry;
mod joined;
mod motion;
mod network;
mod preprocess;
mod ready;
mod training;

use std::process::ExitCode;

use collect::Folder;
use omnix::WeightType;

/// Relative in norm, by how weights are stored.
const LIMITS: [(WeightType, f64); 3] = [(WeightType::F32, 1e-4), (WeightType::F16, 2e-3), (WeightType::I8, 1e-1)];

/// What became of a folder.
pub(crate) enum Outcome {
    /// Something was compared.
    Compared(case::Comparison),
    /// Nothing in it belongs to this version.
    OutOfScope(String),
}

fn main() -> ExitCode {
    let filter: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with('-')).collect();
    let folders = collect::folders();
    let wanted = |label: &str| filter.is_empty() || filter.iter().any(|w| label.contains(w.as_str()));
    let mut tally = Tally::default();
    for folder in &folders {
        if eval::is_one(&folder.path) {
            // Its cases have lines of their own, which may be asked for by name.
            let lines =
                eval::run(&folder.path).into_iter().map(|(case, result)| (format!("{}/{case}", folder.label), result));
            lines
                .filter(|(label, _)| wanted(label))
                .for_each(|(label, result)| tally.line(&label, result.map(Outcome::Compared)));
        } else if wanted(&folder.label) {
            tally.line(&folder.label, run(folder));
        }
    }
    let Tally { passed, failed, skipped } = tally;
    let result = if failed == 0 { "ok" } else { "FAILED" };
    println!(
        "\ntest result: {result}. {passed} passed; {failed} failed; {skipped} ignored; 0 measured; 0 filtered out"
    );
    // No folder at all is no success: the small copies belong to the repository.
    if failed == 0 && passed > 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

/// How many lines there were of each kind.
#[derive(Default)]
struct Tally {
    passed: usize,
    failed: usize,
    skipped: usize,
}

impl Tally {
    /// Prints a line and counts it.
    fn line(&mut self, label: &str, outcome: Result<Outcome, String>) {
        match outcome {
            Ok(Outcome::Compared(case::Comparison { tensors, worst, at, half, byte, failures })) => {
                let verdict = if failures.is_empty() { "pass" } else { "FAIL" };
                let with = |kind: &str, error: f64| {
                    if error > 0.0 { format!("; with {kind} weights {error:.3e}") } else { String::new() }
                };
                let rest = with("f16", half) + &with("int8", byte);
                let at = if at.is_empty() { at } else { format!(", worst {at}") };
                println!("{label:<40} {worst:.3e}  {verdict}  ({tensors} tensors{at}{rest})");
                failures.iter().take(12).for_each(|f| println!("    {f}"));
                if failures.is_empty() { self.passed += 1 } else { self.failed += 1 }
            }
            Ok(Outcome::OutOfScope(why)) => {
                println!("{label:<40} -          skipped  ({why})");
                self.skipped += 1;
            }
            Err(error) => {
                println!("{label:<40} -          FAIL  ({error})");
                self.failed += 1;
            }
        }
    }
}

/// Everything in one folder: networks, then the tables and pictures beside them.
fn run(folder: &Folder) -> Result<Outcome, String> {
    let mut total = case::Comparison::default();
    if folder.file("losses.json").is_some() && !folder.cases().is_empty() {
        training::run(folder, &mut total)?;
        return Ok(Outcome::Compared(total));
    }
    network::run(folder, &LIMITS, &mut total)?;
    geometry::run(folder, &mut total)?;
    preprocess::run(folder, &mut total)?;
    if total.tensors == 0 && folder.cases().is_empty() {
        return Err("there is no case folder in it".to_owned());
    }
    if total.tensors == 0 {
        return Ok(Outcome::OutOfScope("no recorded tensor of a part that exists".to_owned()));
    }
    Ok(Outcome::Compared(total))
}
