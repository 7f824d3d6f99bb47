//! The pool of threads that pictures, weights and digests are worked on with. Where the system gives fewer than there are
//! processors (`ulimit -u`, a container's limit) it has those, and where it gives none the main thread does their work.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread::{Builder, available_parallelism, scope};

use crate::error::CliError;

static ALONE: AtomicBool = AtomicBool::new(false);

/// Starts the pool.
pub(crate) fn start() -> Result<(), CliError> {
    let wanted = available_parallelism().map_or(1, usize::from);
    let given = startable(wanted);
    let pool = match given {
        0 => rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread(),
        n if n < wanted => rayon::ThreadPoolBuilder::new().num_threads(n),
        // As many as there are processors, or as RAYON_NUM_THREADS says.
        _ => rayon::ThreadPoolBuilder::new(),
    };
    ALONE.store(given == 0, Ordering::SeqCst);
    pool.build_global().map_err(CliError::Threads)
}

/// Whether the main thread is the pool: then nothing else may wait for the pool's work.
pub(crate) fn alone() -> bool {
    ALONE.load(Ordering::SeqCst)
}

/// How many of `wanted` threads the system lets live at a time. A pool that could not start all of its threads cannot be tried
/// again with fewer, so they are counted first.
fn startable(wanted: usize) -> usize {
    let gate = Mutex::new(());
    let closed = gate.lock().unwrap_or_else(PoisonError::into_inner);
    scope(|scope| {
        let wait = || drop(gate.lock().unwrap_or_else(PoisonError::into_inner));
        let started = (0..wanted).take_while(|_| Builder::new().spawn_scoped(scope, wait).is_ok()).count();
        drop(closed);
        started
    })
}

#[cfg(test)]
mod tests {
    use super::startable;

    #[test]
    fn threads_are_counted() {
        assert_eq!(startable(3), 3);
    }
}
