//! Weights that change from run to run, `[block of 32 columns][k][32]` for the products that read them: what the host does once with a
//! checkpoint's weights ([`crate::packed`]), done on the device with those that are being trained.

use omnix_shaders::pack as shaders;

use crate::winograd::PLACES;
use crate::{Arg, Caps, Dispatch, KernelError, PackedWeights, WeightType};

/// The tensor in the order of the checkpoint.
pub const X: Arg = Arg(0);
/// The packed matrix; [`PackedWeights::bytes`] bytes.
pub const Y: Arg = Arg(1);

/// Where the weight of column n at depth k lies in a tensor:
/// `base + n_hi · (n / n_lo) + n_step · (n % n_lo) + k_hi · (k / k_lo) + k_step · (k % k_lo)`, modulo 2³².
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Order {
    /// Of column 0 at depth 0.
    pub base: u32,
    /// Columns are counted in groups of this number, at least 1.
    pub n_lo: u32,
    /// From one group to the next.
    pub n_hi: u32,
    /// From one column of a group to the next.
    pub n_step: u32,
    /// Depths are counted in groups of this number, at least 1.
    pub k_lo: u32,
    /// From one group to the next; may count down.
    pub k_hi: u32,
    /// From one depth of a group to the next.
    pub k_step: u32,
}

impl Order {
    /// The index of column `n` at depth `k`.
    #[must_use]
    pub const fn index(&self, k: usize, n: usize) -> usize {
        let (k, n) = (k as u32, n as u32);
        let column = self.n_hi.wrapping_mul(n / self.n_lo).wrapping_add(self.n_step.wrapping_mul(n % self.n_lo));
        let depth = self.k_hi.wrapping_mul(k / self.k_lo).wrapping_add(self.k_step.wrapping_mul(k % self.k_lo));
        self.base.wrapping_add(column).wrapping_add(depth) as usize
    }
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Pack {
    /// The packed matrix, f32 or f16.
    pub weights: PackedWeights,
    /// Where its numbers are.
    pub order: Order,
    /// Numbers of the tensor.
    pub elements: u32,
    /// Whether the nine weights of each column and channel become what Winograd's algorithm multiplies by
    /// ([`crate::winograd::transform`]). `weights` is then of the shape [`crate::winograd::Winograd::weights`], f32, and `order` says where
    /// the nine are: depth is tap · channels + channel.
    pub winograd: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/pack`.
    pub struct PackParams {
        n: u32,
        k: u32,
        blocks: u32,
        first_block: u32,
        rows: u32,
        base: u32,
        n_lo: u32,
        n_hi: u32,
        n_step: u32,
        k_lo: u32,
        k_hi: u32,
        k_step: u32,
        chunks: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

/// Rows of a column that an invocation owns (`ROWS` in the sidecar file).
const ROWS: u64 = 16;

impl Pack {
    /// Bytes read and written once each.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.elements) + self.weights.bytes()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When the tensor or a block of 32 columns is larger than the device's binding limit, the matrix is empty or has numbers that the
    /// tensor has not, or it is to be stored as int8.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let (kernel, limit) = ("pack", caps.max_binding);
        let unsupported = |reason: String| KernelError::Unsupported { kernel, reason };
        let PackedWeights { n, k, storage } = self.weights;
        let Order { base, n_lo, n_hi, n_step, k_lo, k_hi, k_step } = self.order;
        let shader = match storage {
            WeightType::F32 if self.winograd => &shaders::WINOGRAD,
            WeightType::F32 => &shaders::F32,
            WeightType::F16 if !self.winograd => &shaders::F16,
            WeightType::F16 => return Err(unsupported("transformed weights need more digits than f16 has".to_owned())),
            WeightType::I8 => return Err(unsupported("weights in training are stored as f32 or f16".to_owned())),
        };
        if n == 0 || k == 0 || n_lo == 0 || k_lo == 0 {
            return Err(unsupported(format!("a matrix of {k} by {n}; it needs at least one row and one column")));
        }
        if self.winograd && (n_lo != 1 || u64::from(k) != u64::from(PLACES) * u64::from(k_lo)) {
            return Err(unsupported(format!("a matrix of {k} by {n} for {k_lo} channels of {PLACES} places each")));
        }
        let taken = if self.winograd { 9 * k_lo } else { k };
        if u64::from(n) * u64::from(taken) > u64::from(self.elements) {
            return Err(unsupported(format!("a matrix of {taken} by {n} from a tensor of {} numbers", self.elements)));
        }
        let (source, block) = (u64::from(self.elements) * 4, self.weights.block_bytes());
        for bytes in [source, block] {
            if bytes > limit {
                return Err(KernelError::RowTooLarge { kernel, bytes, limit });
            }
        }
        let step = (limit / block).max(1);
        let blocks = u64::from(self.weights.blocks());
        let dispatch = |first: u64| {
            let count = step.min(blocks - first);
            let rows = block / 128;
            // Invocations that share a column: each has some rows of it, or all places of a channel.
            let chunks = if self.winograd { u64::from(k_lo) } else { rows.div_ceil(ROWS) };
            let params = PackParams {
                n,
                k,
                blocks: count as u32,
                first_block: first as u32,
                rows: rows as u32,
                base,
                n_lo,
                n_hi,
                n_step,
                k_lo,
                k_hi,
                k_step,
                chunks: chunks as u32,
                pad0: 0,
                pad1: 0,
                pad2: 0,
            };
            let windows = [X.window(0, source), Y.window(first * block, count * block)];
            Dispatch::new(shader, &params, &windows, (count * chunks).div_ceil(2))
        };
        Ok((0..blocks).step_by(step as usize).map(dispatch).collect())
    }
}
