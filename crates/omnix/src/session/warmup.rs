//! Pipelines of all stages, made on threads of their own while weights are read and stages run.
//!
//! lavapipe makes a pipeline's machine code only at its first dispatch, on one thread. Where its cache of them turns out to be empty, the
//! threads go on and compile on devices of their own, from the last kernel to the first, while the run itself compiles
//! from the first on: each finds in the cache what the others did.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
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
/// A product's code comes from the cache in less, and is compiled in more.
const CACHED: Duration = Duration::from_millis(100);

/// The threads; they end with the last pipeline, or soon after this is dropped.
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
    /// Whether the driver's cache is empty: the first thread finds out.
    cold: OnceLock<bool>,
    /// How many of the last ones have been taken to be compiled.
    compiled: AtomicUsize,
}

impl Warmup {
    /// Starts the threads. Where none is to be had (the web), stages make their pipelines when they start.
    pub(super) fn start(gpu: &Gpu, plan: &RunPlan) -> Self {
        let (gpu, plan) = (gpu.clone(), plan.clone());
        let (next, compiled) = (AtomicUsize::new(0), AtomicUsize::new(0));
        let work = Arc::new(Work { gpu, plan, kernels: OnceLock::new(), next, cold: OnceLock::new(), compiled });
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
        let kernels = self.kernels.get_or_init(|| distinct(&self.plan));
        let first = thread == 0;
        if first {
            let cold = self.gpu.caps.tier == Tier::Software && self.is_cold(kernels);
            let _ = self.cold.set(cold);
        }
        // With an empty cache, making pipelines would wait for the run, which holds the device's queue while it compiles.
        let stay = || first || !self.cold.get().is_some_and(|cold| *cold);
        let next = || kernels.get(self.next.fetch_add(1, Ordering::Relaxed));
        // An error is met again, and reported, where the pipeline is needed.
        while stay()
            && let Some(dispatch) = next()
        {
            let _ = self.gpu.prepare(dispatch);
        }
        // The run itself keeps one processor busy with compiling.
        if (1..=SIBLINGS).contains(&thread) && *self.cold.wait() {
            self.compile(kernels);
        }
    }

    /// Whether the first product has to be compiled. That it is then is no loss: it is needed soon.
    fn is_cold(&self, kernels: &[Dispatch]) -> bool {
        let product = kernels.iter().find(|dispatch| dispatch.shader.kernel == "linear");
        product.is_some_and(|dispatch| compile(&self.gpu, dispatch).is_ok_and(|time| time > CACHED))
    }

    fn compile(&self, kernels: &[Dispatch]) {
        let Some(sibling) = self.gpu.sibling() else { return };
        let take = || kernels.len().checked_sub(1 + self.compiled.fetch_add(1, Ordering::Relaxed));
        while let Some(dispatch) = take().and_then(|i| kernels.get(i)) {
            let _ = compile(&sibling, dispatch);
        }
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
        self.work.next.store(usize::MAX / 2, Ordering::Relaxed);
        self.work.compiled.store(usize::MAX / 2, Ordering::Relaxed);
        for thread in self.threads.drain(..) {
            // A panic there is a bug that the stage meets itself.
            let _ = thread.join();
        }
    }
}
