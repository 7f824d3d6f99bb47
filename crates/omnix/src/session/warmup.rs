//! Pipelines of all stages, made on threads of their own while weights are read and stages run.
//!
//! lavapipe makes a pipeline's machine code only at its first dispatch, on one thread. Where its cache of them turns out to be empty, other
//! threads compile on devices of their own, from the last kernel to the first, while the run itself compiles from the
//! first on: each finds in the cache what the others did.

use std::collections::HashSet;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::Duration;

use omnix_kernels::compile::compile;
use omnix_kernels::{Dispatch, Gpu, Tier};

use crate::plan::RunPlan;

/// More threads than this only wait for the driver.
const MOST_THREADS: usize = 4;
/// Threads that compile on devices of their own; each takes about 100 MiB while it does.
const SIBLINGS: usize = 2;
/// A run that has less memory does without them.
const ROOMY: u64 = 2 << 30;
/// The code of a large product comes from the cache in less, and is compiled in more.
const CACHED: Duration = Duration::from_millis(100);

/// The threads; they end with the last pipeline, or with the one at hand after this is dropped.
#[derive(Debug)]
pub(super) struct Warmup {
    work: Arc<Work>,
    threads: Vec<JoinHandle<()>>,
}

#[derive(Debug)]
struct Work {
    gpu: Gpu,
    /// Still to be planned: the first thread does it.
    plan: RunPlan,
    kernels: OnceLock<Vec<Dispatch>>,
    /// The next of them to be taken.
    next: AtomicUsize,
    /// Whether the driver's cache is empty and siblings can help: the first thread finds out.
    cold: OnceLock<bool>,
    /// How many of the last ones have been taken to be compiled.
    compiled: AtomicUsize,
    /// Nobody needs the rest.
    stop: AtomicBool,
}

impl Warmup {
    /// Starts the threads. Where none is to be had (the web), stages make their pipelines when they start.
    pub(super) fn start(gpu: &Gpu, plan: &RunPlan) -> Self {
        let work = Arc::new(Work {
            gpu: gpu.clone(),
            plan: plan.clone(),
            kernels: OnceLock::new(),
            next: AtomicUsize::new(0),
            cold: OnceLock::new(),
            compiled: AtomicUsize::new(0),
            stop: AtomicBool::new(false),
        });
        let count = std::thread::available_parallelism().map_or(1, |n| n.get().min(MOST_THREADS));
        let thread = |i: usize| {
            let work = Arc::clone(&work);
            let go_through = move || work.go_through(i);
            std::thread::Builder::new().name(format!("pipelines {i}")).spawn(go_through).ok()
        };
        let threads = (0..count).map_while(thread).collect();
        Self { work, threads }
    }
}

impl Work {
    fn go_through(&self, thread: usize) {
        let first = thread == 0;
        let answer = first.then(|| Answer(&self.cold));
        let kernels = self.kernels.get_or_init(|| distinct(&self.plan));
        if let Some(answer) = answer {
            answer.give(self.is_cold(kernels));
        }
        // With an empty cache, making pipelines would wait for the run, which holds the device's queue while it compiles.
        let stay = || first || !self.cold.get().is_some_and(|cold| *cold);
        let next = || kernels.get(self.next.fetch_add(1, Ordering::Relaxed));
        // An error is met again, and reported, where the pipeline is needed.
        while self.goes_on()
            && stay()
            && let Some(dispatch) = next()
        {
            let _ = self.gpu.prepare(dispatch);
        }
        // The run itself keeps one processor busy with compiling.
        if (1..=SIBLINGS).contains(&thread) && *self.cold.wait() && self.goes_on() {
            self.compile(kernels);
        }
    }

    fn goes_on(&self) -> bool {
        !self.stop.load(Ordering::Relaxed)
    }

    /// Whether the longest product has to be compiled, and other devices may help. That it is compiled then is no loss: it is needed soon.
    fn is_cold(&self, kernels: &[Dispatch]) -> bool {
        let may = self.gpu.caps.tier == Tier::Software
            && self.gpu.has_siblings()
            && self.plan.request.budget.is_none_or(|bytes| bytes >= ROOMY);
        let products = kernels.iter().filter(|dispatch| dispatch.shader.kernel == "linear");
        let longest = products.max_by_key(|dispatch| dispatch.shader.wgsl.len());
        // A pipeline that an earlier run made has been compiled.
        may && longest.is_some_and(|dispatch| {
            !self.gpu.is_prepared(dispatch)
                && self.goes_on()
                && compile(&self.gpu, dispatch).is_ok_and(|time| time > CACHED)
        })
    }

    fn compile(&self, kernels: &[Dispatch]) {
        let Some(sibling) = self.gpu.sibling() else { return };
        let take = || kernels.len().checked_sub(1 + self.compiled.fetch_add(1, Ordering::Relaxed));
        while self.goes_on()
            && let Some(dispatch) = take().and_then(|i| kernels.get(i))
        {
            // What a device that fails does not compile the run does.
            if compile(&sibling, dispatch).is_err() {
                return;
            }
        }
    }
}

/// What other threads wait for: no, if the thread that was to find out breaks down.
struct Answer<'a>(&'a OnceLock<bool>);

impl Answer<'_> {
    fn give(&self, answer: bool) {
        let _ = self.0.set(answer);
    }
}

impl Drop for Answer<'_> {
    fn drop(&mut self) {
        self.give(false);
    }
}

/// One dispatch of each kernel variant that the run needs, in the order of their first use.
fn distinct(plan: &RunPlan) -> Vec<Dispatch> {
    let mut seen = HashSet::new();
    let kernels = plan.plans().flat_map(|(plan, _)| plan.kernels().unwrap_or_default());
    kernels.filter(|d| seen.insert((d.shader.kernel, d.shader.variant))).collect()
}

impl Drop for Warmup {
    fn drop(&mut self) {
        self.work.stop.store(true, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A panic there is a bug that the stage meets itself.
            let _ = thread.join();
        }
    }
}
