//! What the caller of a plan decides.

use omnix_kernels::WeightType;

/// What the caller decides. Made by [`PlanOptions::default`] and changed by the methods of its fields' names.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct PlanOptions {
    /// Bytes that everything but weights that stay may take; `None` for no bound.
    pub budget: Option<u64>,
    /// Whether weights pass through ([`crate::Streamed`]): then the budget is for them too.
    pub streamed: bool,
    /// Whether a differentiated graph that does not fit the budget may compute values of its forward pass again instead of keeping them:
    /// as many as it takes, which changes no bit of a result and costs operations ([`crate::Plan::recomputed`]).
    /// Where weights pass through, nothing is.
    pub recompute: bool,
    /// How matrices are stored.
    pub storage: WeightType,
    /// Whether to fuse; off only in tests that compare.
    pub fuse: bool,
    /// Minimum number of row chunks per chain. Leave at 1; tests raise it.
    pub parts: usize,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { budget: None, streamed: false, recompute: false, storage: WeightType::F32, fuse: true, parts: 1 }
    }
}

impl PlanOptions {
    /// Bytes that everything but weights that stay may take; `None` for no bound.
    #[must_use]
    pub fn budget(mut self, budget: impl Into<Option<u64>>) -> Self {
        self.budget = budget.into();
        self
    }

    /// Whether weights pass through.
    #[must_use]
    pub fn streamed(mut self, streamed: bool) -> Self {
        self.streamed = streamed;
        self
    }

    /// Whether values may be computed again instead of kept.
    #[must_use]
    pub fn recompute(mut self, recompute: bool) -> Self {
        self.recompute = recompute;
        self
    }

    /// How matrices are stored.
    #[must_use]
    pub fn storage(mut self, storage: WeightType) -> Self {
        self.storage = storage;
        self
    }

    /// Whether to fuse.
    #[must_use]
    pub fn fuse(mut self, fuse: bool) -> Self {
        self.fuse = fuse;
        self
    }

    /// Minimum number of row chunks per chain.
    #[must_use]
    pub fn parts(mut self, parts: usize) -> Self {
        self.parts = parts;
        self
    }
}
