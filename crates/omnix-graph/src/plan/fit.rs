//! How many parts chains go in, so that a plan fits its budget.

use omnix_kernels::Caps;

use super::memory::{MemoryPlan, assign};
use super::options::PlanOptions;
use super::schedule::{Segment, segments};
use super::stretch::passing_bytes;
use crate::error::GraphError;
use crate::ops::Graph;

/// More parts than this gain nothing: chains are down to single images long before.
const MAX_PARTS: usize = 1 << 14;

/// Chains, the parts they go in, and the memory that takes.
pub(crate) struct Fit {
    pub(crate) segments: Vec<Segment>,
    pub(crate) parts: usize,
    pub(crate) memory: MemoryPlan,
    /// Bytes that the budget is for.
    bytes: u64,
}

/// The fewest parts whose memory fits the budget and the device's largest buffer. Where weights pass through, short chains need few
/// weights at once and long ones have less between them: whichever does with fewer parts.
pub(crate) fn fit(graph: &Graph, fixed: usize, caps: &Caps, options: &PlanOptions) -> Result<Fit, GraphError> {
    let with = |short| fit_parts(graph, segments(graph, fixed, caps.align, short), fixed, caps, options);
    let long = with(false);
    if !options.streamed || long.as_ref().is_ok_and(|fit| fit.parts == 1) {
        return long;
    }
    match (long, with(true)) {
        (Ok(long), Ok(short)) if (short.parts, short.bytes) < (long.parts, long.bytes) => Ok(short),
        (Err(GraphError::Budget { least: a, budget }), Err(GraphError::Budget { least: b, .. })) => {
            Err(GraphError::Budget { budget, least: a.min(b) })
        }
        (Err(_), short) => short,
        (long, _) => long,
    }
}

fn fit_parts(
    graph: &Graph,
    segments: Vec<Segment>,
    fixed: usize,
    caps: &Caps,
    options: &PlanOptions,
) -> Result<Fit, GraphError> {
    let budget = options.budget.unwrap_or(u64::MAX);
    let weights =
        |parts| if options.streamed { passing_bytes(graph, &segments, parts, options.storage, caps) } else { 0 };
    // Depends on whether chains go in chunks, not on how many.
    let passing = [weights(1), weights(2)];
    let mut parts = options.parts.max(1);
    let mut least = u64::MAX;
    loop {
        let tried = assign(graph, &segments, fixed, parts, caps.max_buffer);
        let smallest = |s: &Segment| s.chain.as_ref().is_none_or(|c| c.chunk_rows(parts) <= c.unit);
        let last = parts >= MAX_PARTS || segments.iter().all(smallest);
        match tried {
            Ok(memory) => {
                let bytes = memory.total() + passing[usize::from(parts > 1)];
                if bytes <= budget {
                    return Ok(Fit { segments, parts, memory, bytes });
                }
                least = least.min(bytes);
            }
            Err(error) if last => return Err(error),
            Err(_) => {}
        }
        if last {
            return Err(GraphError::Budget { budget, least });
        }
        parts *= 2;
    }
}
