//! `omnix completions`: completions of the command line for a shell.

use clap::Args;
use clap_complete::Shell;

use crate::error::CliError;
use crate::ui;

/// Arguments of `omnix completions`.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// The shell. For bash: `omnix completions bash > ~/.local/share/bash-completion/completions/omnix`.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// Prints the script for `command`, the whole command line.
pub(crate) fn run(args: &CompletionsArgs, mut command: clap::Command) -> Result<(), CliError> {
    let mut script = Vec::new();
    clap_complete::generate(args.shell, &mut command, "omnix", &mut script);
    ui::print(&String::from_utf8_lossy(&script))
}
