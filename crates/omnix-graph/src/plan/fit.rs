//! How many parts chains go in, so that a plan fits its budget.

use omnix_kernels::Caps;

use super::memory::{Lives, MemoryPlan, lives};
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
    let with = |short| {
        let chains = Chains { graph, segments: segments(graph, fixed, caps.align, short), fixed, caps, options };
        chains.fit()?.or_else(|too_much| {
            let budget = options.budget.unwrap_or(u64::MAX);
            Err(GraphError::Budget { budget, least: chains.least(too_much)? })
        })
    };
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

/// As [`fit`] with weights that stay; none where the budget is too small, without the search for the least that works.
pub(crate) fn fits(graph: &Graph, fixed: usize, caps: &Caps, options: &PlanOptions) -> Result<Option<Fit>, GraphError> {
    let chains = Chains { graph, segments: segments(graph, fixed, caps.align, false), fixed, caps, options };
    Ok(chains.fit()?.ok())
}

/// The fewest bytes that are alive at once in any number of parts, and the least budget that works, if that is `below` this one: `below`
/// itself otherwise.
pub(crate) fn least(
    graph: &Graph,
    fixed: usize,
    caps: &Caps,
    options: &PlanOptions,
    below: u64,
) -> Result<(u64, u64), GraphError> {
    let options = &options.budget(0);
    let chains = Chains { graph, segments: segments(graph, fixed, caps.align, false), fixed, caps, options };
    let Err(too_much) = chains.fit()? else { return Ok((0, 0)) };
    let alive = too_much.alive.iter().map(|(_, bytes)| *bytes).min().unwrap_or(u64::MAX);
    Ok((alive, chains.least(TooMuch { least: below, ..too_much })?))
}

/// A graph in chains that are to be cut.
struct Chains<'a> {
    graph: &'a Graph,
    segments: Vec<Segment>,
    fixed: usize,
    caps: &'a Caps,
    options: &'a PlanOptions,
}

/// What was tried for a budget that is too small.
struct TooMuch {
    /// Parts in which more is alive at once than the budget, with the bytes that are.
    alive: Vec<(usize, u64)>,
    /// The fewest bytes of what was tried to the end.
    least: u64,
}

impl Chains<'_> {
    fn fit(&self) -> Result<Result<Fit, TooMuch>, GraphError> {
        let budget = self.options.budget.unwrap_or(u64::MAX);
        // Depends on whether chains go in chunks, not on how many.
        let passing = [self.passing(1), self.passing(2)];
        let mut parts = self.options.parts.max(1);
        let mut too_much = TooMuch { alive: Vec::new(), least: u64::MAX };
        let mut before = None;
        loop {
            let smallest = |s: &Segment| s.chain.as_ref().is_none_or(|c| c.chunk_rows(parts) <= c.unit);
            let last = parts >= MAX_PARTS || self.segments.iter().all(smallest);
            let passing = passing[usize::from(parts > 1)];
            match self.lives(parts) {
                Ok(lives) => {
                    let alive = lives.least() + passing;
                    // As much as in half the parts: hardly anything has changed, and values computed again do more.
                    let tried = before.replace(alive) == Some(alive) && self.options.recompute;
                    if alive > budget && !tried {
                        too_much.alive.push((parts, alive));
                    } else if !tried {
                        let memory = lives.share();
                        let bytes = memory.total() + passing;
                        if bytes <= budget {
                            return Ok(Ok(Fit { segments: self.segments.clone(), parts, memory, bytes }));
                        }
                        too_much.least = too_much.least.min(bytes);
                    }
                }
                Err(error) if last => return Err(error),
                Err(_) => {}
            }
            if last {
                return Ok(Err(too_much));
            }
            parts *= 2;
        }
    }

    /// The least budget that works, if it is below that of what was tried.
    fn least(&self, TooMuch { mut alive, mut least }: TooMuch) -> Result<u64, GraphError> {
        alive.sort_by_key(|(_, bytes)| *bytes);
        for (parts, alive) in alive {
            if alive < least {
                least = least.min(self.lives(parts)?.share().total() + self.passing(parts));
            }
        }
        Ok(least)
    }

    fn lives(&self, parts: usize) -> Result<Lives, GraphError> {
        lives(self.graph, &self.segments, self.fixed, parts, self.caps.max_buffer)
    }

    /// Bytes of weights that pass through.
    fn passing(&self, parts: usize) -> u64 {
        let PlanOptions { streamed, storage, .. } = *self.options;
        if streamed { passing_bytes(self.graph, &self.segments, parts, storage, self.caps) } else { 0 }
    }
}
