//! How much a plan computes again instead of keeping, so that it fits its budget: as much as it takes and no more.

use omnix_kernels::Caps;

use super::fit::{Fit, fit, fits, least};
use super::options::PlanOptions;
use crate::error::GraphError;
use crate::ops::Graph;
use crate::passes::recompute::{Level, apply, levels};

/// A graph with what it computes again, and its memory.
pub(crate) struct Fitted {
    pub(crate) graph: Graph,
    pub(crate) fit: Fit,
    /// Operations of what is computed again.
    pub(crate) flops: u64,
}

/// Fits `graph` to the budget: as it is, or where that does not do and the caller allows it, with the fewest operations more.
pub(crate) fn fit_repeating(
    graph: Graph,
    fixed: usize,
    caps: &Caps,
    options: &PlanOptions,
) -> Result<Fitted, GraphError> {
    let whole = |graph: Graph| fit(&graph, fixed, caps, options).map(|fit| Fitted { graph, fit, flops: 0 });
    if !options.recompute || options.streamed {
        return whole(graph);
    }
    if let Some(fit) = fits(&graph, fixed, caps, options)? {
        return Ok(Fitted { graph, fit, flops: 0 });
    }
    let levels = levels(&graph, fixed);
    let Some((last, cheaper)) = levels.split_last() else { return whole(graph) };
    let tightest = apply(&graph, &last.order);
    let Some(fit) = fits(&tightest, fixed, caps, options)? else {
        return fit_tightly(&graph, &levels, fixed, caps, options);
    };
    let mut fitted = Fitted { graph: tightest, fit, flops: last.flops };
    // The cheapest level that fits: those after it do too.
    let (mut low, mut high) = (0, cheaper.len());
    while low < high {
        let middle = usize::midpoint(low, high);
        let graph = apply(&graph, &cheaper[middle].order);
        match fits(&graph, fixed, caps, options)? {
            Some(fit) => (fitted, high) = (Fitted { graph, fit, flops: cheaper[middle].flops }, middle),
            None => low = middle + 1,
        }
    }
    Ok(fitted)
}

/// Fits `graph` with whichever level takes the least memory, where the last does not fit: buffers that values share take more than what is
/// alive at once, at some levels more than at others.
fn fit_tightly(
    graph: &Graph,
    levels: &[Level],
    fixed: usize,
    caps: &Caps,
    options: &PlanOptions,
) -> Result<Fitted, GraphError> {
    let (mut best, mut fewest) = (None, u64::MAX);
    for level in levels.iter().rev() {
        let graph = apply(graph, &level.order);
        let (alive, bytes) = least(&graph, fixed, caps, options, fewest)?;
        if alive >= fewest {
            // Earlier levels have more alive.
            break;
        }
        if bytes < fewest {
            (best, fewest) = (Some((graph, level.flops)), bytes);
        }
    }
    let budget = options.budget.unwrap_or(u64::MAX);
    let refused = GraphError::Budget { budget, least: fewest };
    let Some((graph, flops)) = best.filter(|_| fewest <= budget) else { return Err(refused) };
    let fit = fits(&graph, fixed, caps, options)?.ok_or(refused)?;
    Ok(Fitted { graph, fit, flops })
}
