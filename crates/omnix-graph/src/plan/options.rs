//! What the caller of a plan decides.

use omnix_kernels::WeightType;

/// What the caller decides.
#[derive(Clone, Copy, Debug)]
pub struct PlanOptions {
    /// Bytes that everything but weights that stay may take; `None` for no bound.
    pub budget: Option<u64>,
    /// Whether weights pass through ([`crate::Streamed`]): then the budget is for them too.
    pub streamed: bool,
    /// How matrices are stored.
    pub storage: WeightType,
    /// Whether to fuse; off only in tests that compare.
    pub fuse: bool,
    /// Minimum number of row chunks per chain. Leave at 1; tests raise it.
    pub parts: usize,
}

impl Default for PlanOptions {
    fn default() -> Self {
        Self { budget: None, streamed: false, storage: WeightType::F32, fuse: true, parts: 1 }
    }
}
