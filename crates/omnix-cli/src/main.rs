//! The program `omnix`: images and videos of a scene in; depth, cameras and points out.

mod args;
mod bytes;
mod cmd;
mod disk;
mod error;
mod folder;
mod job;
mod mask_folder;
mod masking;
mod memory;
mod prepare;
mod ruler;
mod stop;
mod text;
mod threads;
mod ui;
mod windowing;

use std::process::ExitCode;

use clap::Parser as _;

use crate::error::CliError;

fn main() -> ExitCode {
    let cli = match cmd::Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) => return refused(&error),
    };
    log_to_stderr(cli.verbose);
    let mut ui = ui::Ui::new(cli.command.json(), cli.quiet, cli.verbose);
    stop::listen();
    let outcome = threads::start().and_then(|()| cmd::run(cli.command, &mut ui)).and_then(|()| ui.finish());
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            ui.error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

/// A command line that does not parse, or that asks for help or the version.
fn refused(error: &clap::Error) -> ExitCode {
    // A message that cannot be written is no failure.
    let _ = error.print();
    if !error.use_stderr() {
        return ExitCode::SUCCESS;
    }
    let json = std::env::args_os().skip(1).take_while(|arg| arg != "--").any(|arg| arg == "--json");
    if json {
        let usage = CliError::Usage(summary(&error.render().to_string()));
        ui::Ui::new(true, true, false).error_event(&usage);
    }
    ExitCode::from(2)
}

/// The first paragraph of a message of the parser, on one line.
fn summary(message: &str) -> String {
    let first = message.trim_start_matches("error: ").lines().take_while(|line| !line.trim().is_empty());
    first.map(str::trim).collect::<Vec<_>>().join(" ")
}

/// What the libraries log: nothing, since what goes wrong is an error of the program's own; with `--verbose` what ours have to say;
/// or what `OMNIX_LOG` asks for (such as `omnix=debug,wgpu_hal=info`).
fn log_to_stderr(verbose: bool) {
    let usual = if verbose { "warn,omnix=debug,omnix_graph=debug,omnix_io=debug,omnix_kernels=debug" } else { "off" };
    let filter = tracing_subscriber::EnvFilter::try_from_env("OMNIX_LOG")
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new(usual));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_ansi(false).log_internal_errors(false);
    log.with_writer(std::io::stderr).init();
}

#[cfg(test)]
mod tests {
    use super::summary;

    #[test]
    fn usage_errors_in_one_line() {
        let message =
            "error: the following required arguments were not provided:\n  --out <DIR>\n  <INPUT>...\n\nUsage: omnix";
        assert_eq!(summary(message), "the following required arguments were not provided: --out <DIR> <INPUT>...");
    }
}
