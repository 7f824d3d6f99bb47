//! Pipelines of all stages, made on threads of their own while weights are read and stages run.

use std::collections::HashSet;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;

use omnix_kernels::{Dispatch, Gpu};

use crate::plan::RunPlan;

/// More threads than this only wait for the driver.
const MOST_THREADS: usize = 4;

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
}

impl Warmup {
    /// Starts the threads. Where none is to be had (the web), stages make their pipelines when they start.
    pub(super) fn start(gpu: &Gpu, plan: &RunPlan) -> Self {
        let (gpu, plan) = (gpu.clone(), plan.clone());
        let work = Arc::new(Work { gpu, plan, kernels: OnceLock::new(), next: AtomicUsize::new(0) });
        let count = std::thread::available_parallelism().map_or(1, |n| n.get().min(MOST_THREADS));
        let thread = |i: usize| {
            let work = Arc::clone(&work);
            std::thread::Builder::new().name(format!("pipelines {i}")).spawn(move || work.go_through()).ok()
        };
        let threads = (0..count).filter_map(thread).collect();
        Self { work, threads }
    }
}

impl Work {
    fn go_through(&self) {
        let kernels = self.kernels.get_or_init(|| distinct(&self.plan));
        // An error is met again, and reported, where the pipeline is needed.
        while let Some(dispatch) = kernels.get(self.next.fetch_add(1, Ordering::Relaxed)) {
            let _ = self.gpu.prepare(dispatch);
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
        for thread in self.threads.drain(..) {
            // A panic there is a bug that the stage meets itself.
            let _ = thread.join();
        }
    }
}
