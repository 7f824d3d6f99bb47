//! Work of a plan, counted: what a run asks of a device, known before there is one. The same on every machine, so that a
//! test can hold it (`tests/model/work.rs`).

use omnix_kernels::dispatch::{Arg, Dispatch};
use rustc_hash::FxHashSet;

use super::Plan;
use super::record::{Recorded, record};
use crate::error::GraphError;

/// What one run of a plan does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Work {
    /// Dispatches.
    pub dispatches: usize,
    /// Distinct shaders, those of what is computed once included: what a driver compiles.
    pub pipelines: usize,
    /// Bytes of all windows that dispatches see: each is moved at least once (bands of `winograd` share the windows of
    /// their maps, which count for each).
    pub bytes: u64,
    /// Multiply-adds: half the plan's operations.
    pub multiply_adds: u64,
    /// Bytes of everything but the weights at the peak.
    pub working_bytes: u64,
    /// Bytes of the weights as they are stored.
    pub weight_bytes: u64,
}

impl Plan {
    /// One dispatch of each kernel variant this plan needs, in the order of their first use.
    ///
    /// # Errors
    /// As a run would.
    pub fn kernels(&self) -> Result<Vec<Dispatch>, GraphError> {
        let mut seen = rustc_hash::FxHashSet::default();
        let recorded = record(self)?.into_iter().flat_map(|call| call.dispatches);
        Ok(recorded.filter(|d| seen.insert((d.shader.kernel, d.shader.variant))).collect())
    }

    /// Counts the work of one run.
    ///
    /// # Errors
    /// When a kernel cannot take a shape.
    pub fn work(&self) -> Result<Work, GraphError> {
        let recorded = record(self)?;
        let all = || recorded.iter().flat_map(|call| call.dispatches.iter().map(move |dispatch| (call, dispatch)));
        let calls = || all().filter(|(call, _)| call.node >= self.fixed);
        let pipelines: FxHashSet<_> = all().map(|(_, d)| (d.shader.kernel, d.shader.variant)).collect();
        Ok(Work {
            dispatches: calls().count(),
            pipelines: pipelines.len(),
            bytes: calls().map(|(call, dispatch)| bytes_seen(call, dispatch)).sum(),
            multiply_adds: self.flops() / 2,
            working_bytes: self.working_bytes(),
            weight_bytes: self.weight_bytes(),
        })
    }
}

/// Bytes of the windows of one dispatch.
fn bytes_seen(call: &Recorded, dispatch: &Dispatch) -> u64 {
    let present = dispatch.windows.iter().filter(|window| window.arg != Arg::ABSENT);
    let rest = |arg: Arg, offset: u64| call.args[usize::from(arg.0)].size.saturating_sub(offset);
    present.map(|w| w.size.unwrap_or(u64::MAX).min(rest(w.arg, w.offset))).sum()
}
