//! The program `omnix`: images and videos of a scene in; depth, cameras and points out.

mod args;
mod bytes;
mod cmd;
mod disk;
mod error;
mod job;
mod memory;
mod prepare;
mod stop;
mod ui;

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let cli = args::Cli::parse();
    log_to_stderr();
    let json = cli.command.json();
    let mut ui = ui::Ui::new(json);
    match cmd::run(cli.command, &mut ui) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            ui.error(&error);
            ExitCode::from(error.exit_code())
        }
    }
}

/// What the libraries log: errors, or what `OMNIX_LOG` asks for (such as `omnix=debug,wgpu_hal=info`).
fn log_to_stderr() {
    let filter = tracing_subscriber::EnvFilter::try_from_env("OMNIX_LOG")
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("error"));
    tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr).init();
}
