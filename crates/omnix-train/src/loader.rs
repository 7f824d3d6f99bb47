//! Samples made ahead on threads, handed out in their order: how many threads there are changes when a sample is ready and nothing else.

use std::collections::BTreeMap;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;

use crate::TrainError;
use crate::mixture::{Drawn, Mixture};
use crate::peers::Turns;

/// Samples that each thread may be ahead.
const AHEAD: u64 = 2;

/// What the threads share.
struct Shared {
    state: Mutex<State>,
    changed: Condvar,
}

struct State {
    /// The next sample that a thread takes, of those of this process.
    next: u64,
    /// The next one that is handed out.
    wanted: u64,
    ready: BTreeMap<u64, Result<Drawn, TrainError>>,
    ahead: u64,
    closed: bool,
    /// Threads that still run.
    alive: usize,
}

impl Shared {
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn wait<'a>(&self, state: MutexGuard<'a, State>) -> MutexGuard<'a, State> {
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }
}

/// Threads that make samples.
pub struct Loader {
    shared: Arc<Shared>,
    threads: Vec<JoinHandle<()>>,
}

/// Tells the others when a thread ends, however it ends.
struct Ends(Arc<Shared>);

impl Drop for Ends {
    fn drop(&mut self) {
        self.0.lock().alive -= 1;
        self.0.changed.notify_all();
    }
}

impl Loader {
    /// Makes the samples of `mixture` that are this process's, on at least one thread.
    #[must_use]
    pub fn new(mixture: Mixture, turns: Turns, threads: usize) -> Self {
        let threads = threads.clamp(1, 64);
        let state = State {
            next: 0,
            wanted: 0,
            ready: BTreeMap::new(),
            ahead: threads as u64 * AHEAD,
            closed: false,
            alive: threads,
        };
        let shared = Arc::new(Shared { state: Mutex::new(state), changed: Condvar::new() });
        let mixture = Arc::new(mixture);
        let work = |_| {
            let (shared, mixture) = (shared.clone(), mixture.clone());
            std::thread::spawn(move || {
                let ends = Ends(shared);
                make(&ends.0, &mixture, turns);
            })
        };
        let threads = (0..threads).map(work).collect();
        Self { shared, threads }
    }

    /// The next sample.
    ///
    /// # Errors
    /// What keeps it from being read or made.
    ///
    /// # Panics
    /// When all threads have ended, which only a panic of theirs does.
    pub fn take(&self) -> Result<Drawn, TrainError> {
        let mut state = self.shared.lock();
        loop {
            let wanted = state.wanted;
            if let Some(drawn) = state.ready.remove(&wanted) {
                state.wanted += 1;
                self.shared.changed.notify_all();
                return drawn;
            }
            assert!(state.alive > 0, "BUG: the threads that make samples have ended");
            state = self.shared.wait(state);
        }
    }
}

impl Drop for Loader {
    fn drop(&mut self) {
        self.shared.lock().closed = true;
        self.shared.changed.notify_all();
        for thread in self.threads.drain(..) {
            // A panic of a thread was printed when it happened.
            let _ = thread.join();
        }
    }
}

/// The work of a thread.
fn make(shared: &Shared, mixture: &Mixture, turns: Turns) {
    let mut state = shared.lock();
    while !state.closed {
        if state.next >= state.wanted + state.ahead {
            state = shared.wait(state);
            continue;
        }
        let number = state.next;
        state.next += 1;
        drop(state);
        let drawn = mixture.draw(turns.number(number));
        state = shared.lock();
        state.ready.insert(number, drawn);
        shared.changed.notify_all();
    }
}

#[cfg(test)]
mod tests {
    use omnix_data::Sample;

    use super::*;
    use crate::shapes::Shapes;
    use crate::source::Source;

    /// Later samples are ready earlier, and one of them fails.
    struct Uneven;

    impl Source for Uneven {
        fn label(&self) -> String {
            "uneven".to_owned()
        }

        fn sample(&self, seed: u64, number: u64) -> Result<Sample, TrainError> {
            std::thread::sleep(std::time::Duration::from_millis(3 * (3 - number % 4)));
            if number == 9 { Err(TrainError::NothingTrains) } else { Shapes::new(1, [14, 14])?.sample(seed, number) }
        }
    }

    #[test]
    fn any_number_of_threads_gives_the_same_samples_in_order() {
        let all = |threads| {
            let loader = Loader::new(Mixture::new(3, vec![(1.0, Box::new(Uneven))]), Turns::new(2, 1, None), threads);
            (2..14).map(|_| loader.take().map(|drawn| (drawn.number, drawn.sample))).collect::<Vec<_>>()
        };
        let (one, many) = (all(1), all(5));
        for (number, (a, b)) in (2..).zip(one.iter().zip(&many)) {
            match (a, b) {
                (Ok(a), Ok(b)) => assert!(a == b && a.0 == number),
                (Err(a), Err(b)) => {
                    assert!(number == 9 && a.to_string() == b.to_string() && a.to_string().contains("sample 9"))
                }
                _ => panic!("{number}"),
            }
        }
    }
}
