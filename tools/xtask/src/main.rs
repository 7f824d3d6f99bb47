//! `cargo xtask <task>`: the checks of the tree. Exit code 0: nothing wrong; 1: something is; 2: it could not be checked.

use std::error::Error;
use std::io::{self, Write as _};
use std::process::ExitCode;

use xtask::{Level, XtaskError};

const USAGE: &str = "usage: cargo xtask tidy    six places of each kernel, length, header and size of files, \
                     leftovers, arrows between crates, unused dependencies, circles of imports";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["tidy"] => tidy().unwrap_or_else(|error| {
            say(&format!("error: {error}"));
            let mut source = error.source();
            while let Some(cause) = source {
                say(&format!("  because: {cause}"));
                source = cause.source();
            }
            ExitCode::from(2)
        }),
        _ => {
            say(USAGE);
            ExitCode::from(2)
        }
    }
}

fn tidy() -> Result<ExitCode, XtaskError> {
    let findings = xtask::tidy(xtask::root())?;
    for finding in &findings {
        say(&finding.to_string());
    }
    let errors = findings.iter().filter(|finding| finding.level == Level::Error).count();
    say(&format!("tidy: {errors} errors, {} warnings", findings.len() - errors));
    Ok(if errors == 0 { ExitCode::SUCCESS } else { ExitCode::FAILURE })
}

/// Writes a line to standard error. A reader that has gone away is no reason to fail: the exit code still tells.
fn say(line: &str) {
    let _ = writeln!(io::stderr(), "{line}");
}
