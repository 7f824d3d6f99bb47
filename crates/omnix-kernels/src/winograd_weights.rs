//! [`Conv2dWeights`] of 3×3, stride 1, on software devices by Winograd's F(4×4, 3×3): a quarter of the multiplications of the sum over
//! pixels.
//!
//! What [`crate::winograd`] computes forward is `y = Aᵀ (Σ_c U[c] ⊙ V[c]) A` for each tile of 4×4 pixels, with `V = Bᵀ d B` of the input and
//! `U = G w Gᵀ` of the weights. So `dM = A dy Aᵀ`, `dU[o, c] = Σ_tiles dM[o] ⊙ V[c]`, and `dw = Gᵀ dU G`. The sums over tiles are those of
//! [`crate::linear_weights`], one for each of the 36 places, over a band of tiles after the other. The bands follow from the shape alone, so
//! binding limits change no bit; a number that is not finite spreads over its tile.

use omnix_shaders::{winograd as forward, winograd_weights as shaders};

use crate::conv2d::Conv2d;
use crate::conv2d_weights::Conv2dWeights;
pub use crate::conv2d_weights::{DB, DW, DY, X};
use crate::cover::{cover, room};
use crate::dispatch::round_up;
use crate::linear_weights::{Batch, column_sums, column_words};
use crate::winograd::{LANES, PLACES, Winograd};
use crate::{Activation, Arg, Caps, Dispatch, KernelError, PackedWeights, WeightType};

/// Scratch of [`WinogradWeights::parts_words`] numbers: the sums of all places, and those of the bias.
pub const PARTS: Arg = crate::conv2d_weights::PARTS;
/// Scratch of [`WinogradWeights::tiles_words`] numbers: transformed tiles of x, then of dy. A buffer of its own, since what is read in a
/// dispatch must not be in the buffer that it writes.
pub const TILES: Arg = Arg(5);

const KERNEL: &str = "winograd_weights";

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct WinogradWeights {
    /// The gradient, as the sum over pixels.
    pub conv: Conv2dWeights,
}

impl WinogradWeights {
    /// `conv` by this algorithm, where it can be and is faster than the sum over pixels. Frames do not matter, so that a batch is computed
    /// as its images are.
    #[must_use]
    pub fn of(conv: Conv2dWeights, caps: &Caps) -> Option<Self> {
        let this = Self { conv };
        (Winograd::of(this.forward(), caps).is_some() && this.possible(caps)).then_some(this)
    }

    /// Whether the kernels compute this: what the forward pass computes, and the maps that a band sees within a binding.
    fn possible(&self, caps: &Caps) -> bool {
        let forward = Winograd { conv: self.forward() };
        forward.possible(caps)
            && self.seen() * self.frame() <= room(caps)
            && 4 * self.places().max(forward.scratch()) <= caps.max_binding
    }

    /// The convolution whose weights these are.
    fn forward(&self) -> Conv2d {
        let Conv2dWeights { frames, hi, wi, ci, co, kernel, stride, padding, .. } = self.conv;
        let k = ci.saturating_mul(kernel[0]).saturating_mul(kernel[1]);
        Conv2d {
            frames,
            hi,
            wi,
            ci,
            kernel,
            stride,
            padding,
            weights: PackedWeights { k, n: co, storage: WeightType::F32 },
            act: Activation::None,
            relu_input: false,
            bias: false,
            residual: false,
            residual2: false,
        }
    }

    /// Numbers of the larger map of a frame.
    fn frame(&self) -> u64 {
        let [ho, wo] = self.conv.output().map(u64::from);
        let [hi, wi, ci, co] = [self.conv.hi, self.conv.wi, self.conv.ci, self.conv.co].map(u64::from);
        (hi * wi * ci).max(ho * wo * co)
    }

    /// The most frames that a band has tiles of.
    fn seen(&self) -> u64 {
        let forward = Winograd { conv: self.forward() };
        let [across, down] = forward.grid();
        (forward.band().div_ceil((across * down).max(1)) + 1).min(self.conv.frames.into())
    }

    /// Numbers of all places' sums.
    fn places(&self) -> u64 {
        u64::from(PLACES) * u64::from(self.conv.co) * u64::from(self.conv.ci)
    }

    /// 32-bit words of [`PARTS`].
    #[must_use]
    pub fn parts_words(&self) -> u64 {
        let [ho, wo] = self.conv.output().map(u64::from);
        let pixels = u64::from(self.conv.frames) * ho * wo;
        self.bias_start() + if self.conv.bias { column_words(pixels, self.conv.co.into()) } else { 0 }
    }

    /// 32-bit words of [`TILES`].
    #[must_use]
    pub fn tiles_words(&self) -> u64 {
        Winograd { conv: self.forward() }.scratch()
    }

    /// Where the sums of [`DB`] begin in [`PARTS`].
    fn bias_start(&self) -> u64 {
        round_up(self.places(), 64)
    }

    /// The dispatches that compute this on a software device with `caps`.
    ///
    /// # Errors
    /// When it is no convolution of 3×3, stride 1 with channels in eights (out: in fours), the device is no software device, or the maps that
    /// a band of tiles sees, or the sums, exceed its binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if !self.possible(caps) {
            let reason = format!("not by Winograd's algorithm: {:?}", self.conv);
            return Err(KernelError::Unsupported { kernel: KERNEL, reason });
        }
        let forward = Winograd { conv: self.forward() };
        let [ho, wo] = self.conv.output().map(u64::from);
        let [ci, co, frames] = [self.conv.ci, self.conv.co, self.conv.frames].map(u64::from);
        let (x_frame, dy_frame) = (u64::from(self.conv.hi) * u64::from(self.conv.wi) * ci, ho * wo * co);
        let [across, down] = forward.grid();
        let (in_frame, band) = (across * down, forward.band());
        let sums = PARTS.window(0, self.places() * 4);
        let mut out = Vec::new();
        for first in (0..frames * in_frame).step_by(band as usize) {
            let tiles = band.min(frames * in_frame - first);
            let frame = first / in_frame;
            let seen = (first + tiles - 1) / in_frame + 1 - frame;
            let (x, x_rest) = cover(X, frame * x_frame, seen * x_frame, caps);
            let (dy, dy_rest) = cover(DY, frame * dy_frame, seen * dy_frame, caps);
            let mut params = forward.params((first - frame * in_frame, tiles), x_rest, dy_rest);
            // Places lie as close as this band's tiles do: what a longer band left behind is not summed.
            params.stride = tiles as u32;
            let rows = u64::from(PLACES) * tiles;
            let v = TILES.window(0, rows * ci * 4);
            let m = TILES.window(u64::from(PLACES) * band * ci * 4, rows * co * 4);
            out.push(Dispatch::new(&forward::INPUT, &params, &[x, v], (tiles * ci / 8).div_ceil(LANES)));
            out.push(Dispatch::new(&shaders::GRADIENT, &params, &[dy, m], (tiles * co / 4).div_ceil(LANES)));
            let batch = Batch { count: PLACES.into(), rows: tiles, n: co, k: ci, go_on: first > 0 };
            out.push(batch.dispatch([v, m, sums]));
        }
        let params = forward.params((0, 0), 0, 0);
        out.push(Dispatch::new(&shaders::TURN, &params, &[sums, DW.into()], (co * ci).div_ceil(LANES)));
        if self.conv.bias {
            column_sums(KERNEL, (DY, [frames * ho * wo, co]), (PARTS, self.bias_start()), DB, caps, &mut out)?;
        }
        Ok(out)
    }
}
