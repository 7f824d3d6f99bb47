//! A [`Conv2d`] of 3×3, stride 1, on software devices by Winograd's F(4×4, 3×3) (Lavin and Gray 2016, section 4.2): 2¼
//! multiplications per pixel, input and output channel, where the sum over taps has 9.
//!
//! Three passes over a band of tiles (4×4 pixels of y): the tiles of x are transformed, multiplied by the transformed
//! weights, and transformed back. In between they lie in [`SCRATCH`], which is kept small enough for the processor's last cache.
//! Bands hold whatever tiles fit, and a tile is summed alike in all of them, so splitting changes no bit.
//!
//! The transforms add and subtract numbers of one size, so the result is less exact than the sum over taps. How much less the
//! points decide at which the polynomials behind it are evaluated (Barabasz et al. 2020, "Error analysis and improving the
//! accuracy of Winograd convolution"): the paper's 0, ±1, ±2 have four times the error of 0, ±¾, ±1½ here, within 4e-6 of
//! the oracle relative to its largest value, where [`Conv2d`] is within 2e-6. A number that is not finite spreads over its tiles.

use omnix_shaders::winograd as shaders;

use crate::conv2d::Conv2d;
pub use crate::conv2d::{BIAS, RESIDUAL, RESIDUAL2, W, X, Y};
use crate::cover::{cover, room};
use crate::dispatch::Window;
use crate::{Activation, Arg, Caps, Dispatch, KernelError, PackedWeights, Tier, WeightType};

/// Transformed tiles of x and, behind them, of y: [`Winograd::scratch`] words. [`W`] are transformed weights
/// ([`transform`]) of the shape [`Winograd::weights`]; the other arguments are [`Conv2d`]'s.
pub const SCRATCH: Arg = Arg(6);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Winograd {
    /// The convolution; its `weights` are those of the sum over taps.
    pub conv: Conv2d,
}

crate::layout::params! {
    /// `Params` of `shaders/winograd`.
    pub struct WinogradParams {
        tiles: u32,
        tile0: u32,
        pub(crate) stride: u32,
        across: u32,
        down: u32,
        hi: u32,
        wi: u32,
        ho: u32,
        wo: u32,
        ci: u32,
        co: u32,
        pad: u32,
        x_rest: u32,
        y_rest: u32,
        blocks: u32,
        group: u32,
        flags: u32,
        low: f32,
        floor: f32,
        pad0: u32,
    }
}

/// Channels, as the harmonic mean of those in and out, from which on this is faster than the sum over taps: the product takes time
/// by their product, the transforms by their sum.
const NARROWEST: u64 = 32;
/// Operations of a frame by the sum over taps from which on what is saved outweighs two more dispatches and three pipelines to
/// compile.
const SMALLEST: u64 = 1 << 27;
/// Numbers that a tile of x is transformed to, and nine weights are: six by six.
pub const PLACES: u32 = 36;
/// Pixels of y along the side of a tile.
const SIDE: u64 = 4;
/// Tiles that a workgroup of the product owns (`TM` in the sidecar file).
const ROWS: u64 = 32;
/// Invocations of a workgroup of the transforms.
pub(crate) const LANES: u64 = 64;
/// Bytes of scratch a band aims at: what stays in the last cache. Where the weights are more, as much as they, since every band
/// reads all of them.
const SCRATCH_BYTES: u64 = 8 << 20;

impl Winograd {
    /// `conv` by this algorithm, where it can be and is faster than the sum over taps. Frames do not matter, so that a batch
    /// is computed as its images are.
    #[must_use]
    pub fn of(conv: Conv2d, caps: &Caps) -> Option<Self> {
        let (ci, co) = (u64::from(conv.ci), u64::from(conv.weights.n));
        let faster = 2 * ci * co >= NARROWEST * (ci + co) && conv.flops() / u64::from(conv.frames.max(1)) >= SMALLEST;
        let this = Self { conv };
        (faster && this.possible(caps)).then_some(this)
    }

    /// Whether the kernels compute this: f32 weights, since transformed ones need more digits than f16 has; input channels in
    /// eights, output channels in fours; no activation but ReLU, since all of them would be computed to choose one; a frame, the
    /// weights and the scratch within the device's binding limit.
    pub(crate) fn possible(&self, caps: &Caps) -> bool {
        let Conv2d { kernel, stride, hi, wi, ci, weights, .. } = self.conv;
        let [ho, wo] = self.conv.output().map(u64::from);
        let frame = (u64::from(hi) * u64::from(wi) * u64::from(ci)).max(ho * wo * u64::from(weights.n));
        let right =
            caps.tier == Tier::Software && kernel == [3, 3] && stride == 1 && weights.storage == WeightType::F32;
        let some = self.conv.frames > 0
            && ci > 0
            && weights.n > 0
            && ho > 0
            && wo > 0
            && u64::from(weights.k) == 9 * u64::from(ci);
        let units = ci.is_multiple_of(8) && weights.n.is_multiple_of(4);
        let plain = matches!(self.conv.act, Activation::None | Activation::Relu);
        let fits = || frame <= room(caps) && self.weights().bytes().max(self.scratch() * 4) <= caps.max_binding;
        right && some && units && plain && fits()
    }

    /// The shape of the transformed weights: k = place · ci + c.
    #[must_use]
    pub const fn weights(&self) -> PackedWeights {
        PackedWeights { k: PLACES * self.conv.ci, ..self.conv.weights }
    }

    /// Tiles in a row and in a column of a map.
    pub(crate) fn grid(&self) -> [u64; 2] {
        let [ho, wo] = self.conv.output().map(u64::from);
        [wo.div_ceil(SIDE), ho.div_ceil(SIDE)]
    }

    /// Tiles of a band: whole row tiles of the product, alike in all bands.
    pub(crate) fn band(&self) -> u64 {
        let [across, down] = self.grid();
        let row_tile = ROWS * 4 * u64::from(PLACES) * (u64::from(self.conv.ci) + u64::from(self.conv.weights.n));
        let all = (u64::from(self.conv.frames) * across * down).div_ceil(ROWS).max(1);
        let most = (SCRATCH_BYTES.max(self.weights().bytes()) / row_tile).max(1);
        all.div_ceil(all.div_ceil(most)) * ROWS
    }

    /// Words of [`SCRATCH`].
    #[must_use]
    pub fn scratch(&self) -> u64 {
        u64::from(PLACES) * self.band() * (u64::from(self.conv.ci) + u64::from(self.conv.weights.n))
    }

    /// The dispatches that compute this on a software device with `caps`.
    ///
    /// # Errors
    /// When it is no convolution of 3×3, stride 1 with f32 weights, channels in eights (out: in fours) and no activation but
    /// ReLU, the device is no software device, or a frame, the weights or the scratch exceed its binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if !self.possible(caps) {
            let reason = format!("not by Winograd's algorithm: {:?}", self.conv);
            return Err(KernelError::Unsupported { kernel: "winograd", reason });
        }
        let [across, down] = self.grid();
        let [ho, wo] = self.conv.output().map(u64::from);
        let all = u64::from(self.conv.frames);
        let x_frame = u64::from(self.conv.hi) * u64::from(self.conv.wi) * u64::from(self.conv.ci);
        let y_frame = ho * wo * u64::from(self.conv.weights.n);
        let frames = room(caps) / x_frame.max(y_frame);
        let mut out = Vec::new();
        for frame in (0..all).step_by(frames as usize) {
            let frames = frames.min(all - frame);
            let tiles = frames * across * down;
            for tile0 in (0..tiles).step_by(self.band() as usize) {
                let x = cover(X, frame * x_frame, frames * x_frame, caps);
                let maps = |arg: Arg| cover(arg, frame * y_frame, frames * y_frame, caps);
                self.passes((tile0, self.band().min(tiles - tile0)), x, &maps, &mut out);
            }
        }
        Ok(out)
    }

    /// The parameters of all passes over `tiles` tiles from `tile0` of the frames in windows that begin this far before the first pixel.
    pub(crate) fn params(&self, (tile0, tiles): (u64, u64), x_rest: u32, y_rest: u32) -> WinogradParams {
        let conv = &self.conv;
        let ([across, down], [ho, wo]) = (self.grid(), conv.output());
        let one = PackedWeights { k: conv.ci, ..conv.weights };
        WinogradParams {
            tiles: tiles as u32,
            tile0: tile0 as u32,
            stride: self.band() as u32,
            across: across as u32,
            down: down as u32,
            hi: conv.hi,
            wi: conv.wi,
            ho,
            wo,
            ci: conv.ci,
            co: conv.weights.n,
            pad: conv.padding,
            x_rest,
            y_rest,
            blocks: conv.weights.blocks(),
            group: one.row_group(tiles.div_ceil(ROWS), ROWS * u64::from(conv.ci) * 4),
            flags: conv.flags(),
            low: conv.low(),
            floor: if conv.act == Activation::Relu { 0.0 } else { f32::NEG_INFINITY },
            pad0: 0,
        }
    }

    /// The three passes over `tiles` tiles from `tile0` of the frames in the window `x`; `maps` gives windows of maps like y.
    fn passes(
        &self,
        (tile0, tiles): (u64, u64),
        (x, x_rest): (Window, u32),
        maps: &dyn Fn(Arg) -> (Window, u32),
        out: &mut Vec<Dispatch>,
    ) {
        let conv = &self.conv;
        let (ci, co) = (u64::from(conv.ci), u64::from(conv.weights.n));
        let (y, y_rest) = maps(Y);
        let params = self.params((tile0, tiles), x_rest, y_rest);
        let same = |arg: Arg, there: bool| if there { maps(arg).0 } else { Arg::ABSENT.into() };
        let (residual, residual2) = (same(RESIDUAL, conv.residual), same(RESIDUAL2, conv.residual2));
        let products = u64::from(PLACES) * tiles.div_ceil(ROWS) * u64::from(conv.weights.blocks());
        // V, then M: the two sides of the product.
        let bytes = 4 * u64::from(PLACES) * self.band();
        let v = SCRATCH.window(0, bytes * ci);
        let m = SCRATCH.window(bytes * ci, bytes * co);
        let last = [BIAS.when(conv.bias).into(), residual, residual2, y, m];
        out.push(Dispatch::new(&shaders::INPUT, &params, &[x, v], (tiles * ci / 8).div_ceil(LANES)));
        out.push(Dispatch::new(&shaders::PRODUCT, &params, &[W.into(), v, m], products));
        out.push(Dispatch::new(&shaders::OUTPUT, &params, &last, (tiles * co / 4).div_ceil(LANES)));
    }
}

/// `U = G w Gᵀ`, `[place]`, of the nine weights `[ky·3 + kx]` of an input and output channel. Computed in f64.
#[must_use]
pub fn transform(w: [f32; 9]) -> [f32; PLACES as usize] {
    let w = w.map(f64::from);
    let columns: [[f64; 6]; 3] = std::array::from_fn(|kx| evaluate(w[kx], w[3 + kx], w[6 + kx]));
    let rows: [[f64; 6]; 6] = std::array::from_fn(|row| evaluate(columns[0][row], columns[1][row], columns[2][row]));
    std::array::from_fn(|place| rows[place / 6][place % 6] as f32)
}

/// G times a column: a + b·x + c·x² at the points, each over the product of its distances from the others; c at infinity.
fn evaluate(a: f64, b: f64, c: f64) -> [f64; 6] {
    let [near, far] = [0.75_f64, 1.5];
    let even_odd = |x: f64, other: f64| {
        let scale = 1.0 / (2.0 * x * x * (x * x - other * other));
        [(a + b * x + c * x * x) * scale, (a - b * x + c * x * x) * scale]
    };
    let ([n, n_minus], [f, f_minus]) = (even_odd(near, far), even_odd(far, near));
    [a / (near * near * far * far), n, n_minus, f, f_minus, c]
}

#[cfg(test)]
mod tests {
    use super::transform;

    #[test]
    fn a_tap_alone_is_seen_from_its_places() {
        // The tap in the middle: G has 0, near/N, -near/N, far/M, -far/M, 0 for it both ways.
        let mut w = [0.0; 9];
        w[4] = 1.0;
        let g = [0.0, -0.75 / 1.898_437_5, 0.75 / 1.898_437_5, 1.5 / 7.593_75, -1.5 / 7.593_75, 0.0];
        for (place, got) in transform(w).into_iter().enumerate() {
            assert!((f64::from(got) - g[place / 6] * g[place % 6]).abs() < 1e-8, "{place}: {got}");
        }
    }
}
