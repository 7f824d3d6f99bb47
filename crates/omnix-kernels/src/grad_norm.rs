//! The Euclidean norm of many gradients together, and the factor that keeps it below a bound (torch's `clip_grad_norm_`), without a
//! readback: [`Squares`] for each gradient writes the sums of its blocks, [`crate::reduce`] adds those of all gradients, and
//! [`Clip`] makes `[scale · min(1, max_norm / (norm + 1e-6)), norm, bad, 0]` of the sum.
//!
//! `scale` is what gradients are multiplied by before (one over the number of samples that were accumulated); the norm is that of
//! the scaled gradients. `bad` is 1 where the norm is NaN or infinite; then the factor is 0, and [`crate::adamw`] changes nothing.

use omnix_shaders::grad_norm as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// A gradient, `[n]`.
pub const X: Arg = Arg(0);
/// Sums of the blocks of all gradients, `[blocks]`: what [`Squares`] writes.
pub const PARTS: Arg = Arg(1);

/// The sum of all parts, `[1]`: what [`Clip`] reads.
pub const SUM: Arg = Arg(0);
/// Output `[4]` of [`Clip`].
pub const CLIP: Arg = Arg(1);

/// Words of [`CLIP`].
pub const CLIP_WORDS: u32 = 4;

/// Squares of one gradient.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Squares {
    /// Numbers.
    pub n: u64,
    /// Blocks of the gradients before it.
    pub first: u64,
    /// What the gradient is multiplied by.
    pub scale: f32,
}

/// The factor for all gradients.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clip {
    /// The norm that is not exceeded; infinity clips nothing.
    pub max_norm: f32,
    /// What gradients are multiplied by.
    pub scale: f32,
}

crate::layout::params! {
    /// `Params` of `shaders/grad_norm`.
    pub struct GradNormParams {
        n: u32,
        block: u32,
        x_rest: u32,
        parts_rest: u32,
        scale: f32,
        max_norm: f32,
        pad0: u32,
        pad1: u32,
    }
}

/// Numbers of a block.
const BLOCK: u64 = 1024;

/// Blocks of a gradient of n numbers.
#[must_use]
pub const fn blocks(n: u64) -> u64 {
    n.div_ceil(BLOCK)
}

impl Squares {
    /// Bytes read.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * self.n
    }

    /// The dispatches that compute this on a device with `caps`; none where n is 0.
    ///
    /// # Errors
    /// When the device binds less than a block.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let fit = room(caps) / BLOCK * BLOCK;
        if fit == 0 {
            return Err(KernelError::RowTooLarge { kernel: "grad_norm", bytes: BLOCK * 4, limit: caps.max_binding });
        }
        let shader = match caps.tier {
            Tier::Software if self.n.is_multiple_of(4) => &shaders::SOFTWARE,
            _ => &shaders::SQUARES,
        };
        let mut out = Vec::new();
        for first in (0..self.n).step_by(fit as usize) {
            let n = fit.min(self.n - first);
            let (x, x_rest) = cover(X, first, n, caps);
            let (parts, parts_rest) = cover(PARTS, self.first + blocks(first), blocks(n), caps);
            let params = GradNormParams {
                n: n as u32,
                block: BLOCK as u32,
                x_rest,
                parts_rest,
                scale: self.scale,
                max_norm: 0.0,
                pad0: 0,
                pad1: 0,
            };
            out.push(Dispatch::new(shader, &params, &[x, parts], blocks(n)));
        }
        Ok(out)
    }
}

impl Clip {
    /// The dispatch that computes this.
    ///
    /// # Errors
    /// When the bound is not above 0, or the scale is NaN or infinite.
    pub fn record(&self) -> Result<Vec<Dispatch>, KernelError> {
        let Self { max_norm, scale } = *self;
        if max_norm.is_nan() || max_norm <= 0.0 || !scale.is_finite() {
            let reason = format!(
                "norms up to {max_norm} of gradients times {scale}; the bound must be above 0, the scale finite"
            );
            return Err(KernelError::Unsupported { kernel: "grad_norm", reason });
        }
        // What a shader divides may not be infinite.
        let max_norm = max_norm.min(f32::MAX);
        let params = GradNormParams { n: 1, block: 1, x_rest: 0, parts_rest: 0, scale, max_norm, pad0: 0, pad1: 0 };
        let windows = [SUM.window(0, 4), CLIP.window(0, 4 * u64::from(CLIP_WORDS))];
        Ok(vec![Dispatch::new(&shaders::CLIP, &params, &windows, 1)])
    }
}
