//! Signals that end a program: Ctrl-C, SIGTERM (docker, systemd, slurm) and SIGHUP (a terminal that closes).
//!
//! A run is asked to stop between two pieces of work by the first and keeps what is finished; the second ends the program at
//! once. Other commands end at the first. However it ends, files in the making are removed.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use omnix::OmnixError;

use crate::ui;

static ASKED: AtomicBool = AtomicBool::new(false);
static KEEPS_RESULTS: AtomicBool = AtomicBool::new(false);

/// Exit code of a program that was interrupted.
const INTERRUPTED: i32 = 130;

/// Takes the signals from now on. Where the system refuses, they keep ending the program.
pub(crate) fn listen() {
    if let Err(error) = system::hear() {
        tracing::warn!("signals cannot be handled: {error}");
    }
}

/// From now on the first signal asks the run to stop.
pub(crate) fn keep_results() {
    KEEPS_RESULTS.store(true, Ordering::SeqCst);
}

/// Set when a run was asked to stop.
pub(crate) fn flag() -> &'static AtomicBool {
    &ASKED
}

/// Whether a run was asked to stop.
pub(crate) fn asked() -> bool {
    ASKED.load(Ordering::SeqCst)
}

/// The answer to the progress of work that can only go on or break off.
pub(crate) fn flow() -> ControlFlow<()> {
    if asked() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
}

/// The answer to the engine's events.
pub(crate) fn answer() -> Result<(), OmnixError> {
    if asked() { Err(OmnixError::Interrupted) } else { Ok(()) }
}

/// A signal came; this is a thread of its own.
fn received() {
    if ASKED.swap(true, Ordering::SeqCst) || !KEEPS_RESULTS.load(Ordering::SeqCst) {
        omnix::io::output::abandon();
        std::process::exit(INTERRUPTED);
    }
    ui::to_stderr("\nstopping; what is finished will be kept (again: stop at once)");
}

#[cfg(unix)]
mod system {
    use std::io;
    use std::sync::Arc;
    use std::sync::atomic::AtomicBool;
    use std::sync::mpsc::channel;

    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGXFSZ};
    use signal_hook::iterator::Signals;

    /// Listens on a thread of its own, made first: signals whose listener is gone would be lost.
    pub(super) fn hear() -> io::Result<()> {
        // A file above `ulimit -f` is then a write that fails, not the end of the program.
        signal_hook::flag::register(SIGXFSZ, Arc::new(AtomicBool::new(false)))?;
        let (tell, told) = channel();
        let listen = move || {
            let hangup = (!hangups_are_ignored()).then_some(SIGHUP);
            match Signals::new([SIGINT, SIGTERM].into_iter().chain(hangup)) {
                Ok(mut signals) => {
                    let _ = tell.send(Ok(()));
                    signals.forever().for_each(|_| super::received());
                }
                Err(error) => _ = tell.send(Err(error)),
            }
        };
        std::thread::Builder::new().name("signals".to_owned()).spawn(listen)?;
        told.recv().unwrap_or(Ok(()))
    }

    /// Whether the program was started so that it survives its terminal (`nohup`). Where the system does not say, such a start is
    /// not broken: SIGHUP is left as it is.
    fn hangups_are_ignored() -> bool {
        let Ok(status) = std::fs::read_to_string("/proc/self/status") else { return true };
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
        mask >> (SIGHUP - 1) & 1 == 1
    }
}

#[cfg(not(unix))]
mod system {
    pub(super) fn hear() -> Result<(), ctrlc::Error> {
        ctrlc::set_handler(super::received)
    }
}
