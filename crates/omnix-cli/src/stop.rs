//! Ctrl-C: the first asks the run to stop between two pieces of work, the second ends the program at once.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};

use omnix::OmnixError;

static ASKED: AtomicBool = AtomicBool::new(false);

/// Takes the signal from now on. Where the system refuses, Ctrl-C keeps ending the program at once.
pub(crate) fn listen() {
    let set = ctrlc::set_handler(|| {
        if ASKED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
        eprintln!("\nstopping; what is finished will be kept (again: stop at once)");
    });
    if let Err(error) = set {
        tracing::warn!("Ctrl-C cannot be handled: {error}");
    }
}

/// Whether it was pressed.
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
