//! `y = act(conv(pre(x)) + bias) + residual + residual2` on channels-last maps, zero padding, pre the identity or ReLU.
//!
//! `conv(x)[f, oy, ox, o] = Σ_{ky, kx, c} x[f, oy s + ky − pad, ox s + kx − pad, c] · w[ky, kx, c, o]`. The weights are
//! packed as a matrix ([`PackedWeights`]) of depth `k = kh·kw·ci` in the order (ky, kx, c) and `n = co` columns. A 1×1
//! convolution of stride 1 is `linear`, which is faster.
//!
//! Large maps are split over frames, then over bands of output rows; the order of summation of an element depends
//! on the weights' shape alone, so splitting changes no bit.

use omnix_shaders::{Shader, conv2d as shaders};

use crate::caps::Cooperative;
use crate::cover::{cover, room};
use crate::dispatch::Window;
use crate::{Activation, Arg, Caps, Dispatch, KernelError, PackedWeights, Tier, WeightType};

/// Input `[frames, hi, wi, ci]`.
pub const X: Arg = Arg(0);
/// Packed weights.
pub const W: Arg = Arg(1);
/// `[co]`.
pub const BIAS: Arg = Arg(2);
/// `[frames, ho, wo, co]`.
pub const RESIDUAL: Arg = Arg(3);
/// `[frames, ho, wo, co]`.
pub const RESIDUAL2: Arg = Arg(4);
/// Output `[frames, ho, wo, co]`.
pub const Y: Arg = Arg(5);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Conv2d {
    /// Independent maps.
    pub frames: u32,
    /// Input rows.
    pub hi: u32,
    /// Input columns.
    pub wi: u32,
    /// Input channels.
    pub ci: u32,
    /// Rows and columns of the kernel.
    pub kernel: [u32; 2],
    /// Input pixels between neighbouring outputs, both ways.
    pub stride: u32,
    /// Zero rows and columns on every side.
    pub padding: u32,
    /// The weights' shape: `k = kh·kw·ci`, `n = co`.
    pub weights: PackedWeights,
    /// Applied after the bias.
    pub act: Activation,
    /// Whether the input goes through ReLU first.
    pub relu_input: bool,
    /// Whether [`BIAS`] is there.
    pub bias: bool,
    /// Whether [`RESIDUAL`] is there; it may not be the output's buffer.
    pub residual: bool,
    /// Whether [`RESIDUAL2`] is there; it may not be the output's buffer.
    pub residual2: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/conv2d`.
    pub struct Conv2dParams {
        pixels: u32,
        wo: u32,
        frame_pixels: u32,
        hi: u32,
        wi: u32,
        ci: u32,
        co: u32,
        kw: u32,
        taps: u32,
        stride: u32,
        pad: u32,
        oy0: u32,
        iy0: u32,
        x_rest: u32,
        y_rest: u32,
        n0: u32,
        blocks: u32,
        k_packed: u32,
        act: u32,
        flags: u32,
        low: f32,
        group: u32,
        pad0: u32,
        pad1: u32,
    }
}

const HAS_BIAS: u32 = 1;
const HAS_RESIDUAL: u32 = 2;
const HAS_RESIDUAL2: u32 = 4;

/// Output pixels a workgroup of the software variant owns (`TM` in the sidecar file).
const SOFTWARE_PIXELS: u64 = 40;

/// Whole frames, or a band of output rows of one.
struct Piece {
    frame: u64,
    frames: u64,
    row: u64,
    rows: u64,
}

/// What of the weights a dispatch sees.
struct Slice {
    shader: &'static Shader,
    window: Window,
    block: u32,
    blocks: u32,
}

impl Conv2d {
    /// Output rows and columns; 0 where the kernel does not fit.
    #[must_use]
    pub fn output(&self) -> [u32; 2] {
        let one = |n: u32, k: u32| match (n + 2 * self.padding).checked_sub(k) {
            Some(rest) if self.stride > 0 => rest / self.stride + 1,
            _ => 0,
        };
        [one(self.hi, self.kernel[0]), one(self.wi, self.kernel[1])]
    }

    /// Multiply-adds, each counted as two operations; those on padding included.
    #[must_use]
    pub fn flops(&self) -> u64 {
        let [ho, wo] = self.output();
        2 * u64::from(self.frames)
            * u64::from(ho)
            * u64::from(wo)
            * u64::from(self.weights.k)
            * u64::from(self.weights.n)
    }

    /// What is added, as the shaders read it (`shaders/lib/conv2d_flags.wgsl`).
    pub(crate) fn flags(&self) -> u32 {
        let set = |on: bool, flag: u32| if on { flag } else { 0 };
        set(self.bias, HAS_BIAS) | set(self.residual, HAS_RESIDUAL) | set(self.residual2, HAS_RESIDUAL2)
    }

    /// The least value of the input after [`Conv2d::relu_input`].
    pub(crate) const fn low(&self) -> f32 {
        if self.relu_input { 0.0 } else { f32::NEG_INFINITY }
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When the weights' depth is not `kh·kw·ci`, the output is empty, or one row of a map (with the rows its kernel
    /// reaches) is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let [kh, kw] = self.kernel;
        let [ho, wo] = self.output();
        let unsupported = |reason: String| KernelError::Unsupported { kernel: "conv2d", reason };
        if self.weights.k != kh * kw * self.ci {
            let PackedWeights { k, .. } = self.weights;
            return Err(unsupported(format!("weights of depth {k} for a {kh}x{kw} kernel over {} channels", self.ci)));
        }
        if self.frames == 0 || self.weights.k == 0 || self.weights.n == 0 || ho == 0 || wo == 0 {
            return Err(unsupported(format!("nothing to compute: {self:?}")));
        }
        if self.weights.storage == WeightType::I8 {
            return Err(unsupported("int8 weights; they are for linear layers, store these as f16".to_owned()));
        }
        let slices = self.slices(caps);
        let mut out = Vec::new();
        for piece in self.pieces(caps)? {
            out.extend(slices.iter().map(|slice| self.dispatch(&piece, slice, caps)));
        }
        Ok(out)
    }

    /// Frames and bands whose input and output fit into a binding.
    fn pieces(&self, caps: &Caps) -> Result<Vec<Piece>, KernelError> {
        let [ho, wo] = self.output().map(u64::from);
        let (hi, kh, stride) = (u64::from(self.hi), u64::from(self.kernel[0]), u64::from(self.stride));
        let x_row = u64::from(self.wi) * u64::from(self.ci);
        let y_row = wo * u64::from(self.weights.n);
        let (room, all) = (room(caps), u64::from(self.frames));
        // Rows of the output that are short enough for one dispatch.
        let short = (caps.max_operations() / self.operations(1, wo, self.weights.blocks())).max(1);
        let mut pieces = Vec::new();
        let frames = (room / (hi * x_row).max(ho * y_row)).min(short / ho);
        if frames > 0 {
            let starts = (0..all).step_by(frames as usize);
            pieces.extend(starts.map(|frame| Piece { frame, frames: frames.min(all - frame), row: 0, rows: ho }));
            return Ok(pieces);
        }
        let x_rows = room / x_row;
        let rows = (room / y_row).min(short).min(if x_rows < kh { 0 } else { (x_rows - kh) / stride + 1 });
        if rows == 0 {
            let bytes = 4 * y_row.max(x_row * kh);
            return Err(KernelError::RowTooLarge { kernel: "conv2d", bytes, limit: caps.max_binding });
        }
        for frame in 0..all {
            let starts = (0..ho).step_by(rows as usize);
            pieces.extend(starts.map(|row| Piece { frame, frames: 1, row, rows: rows.min(ho - row) }));
        }
        Ok(pieces)
    }

    /// All columns of the weights, or as many as a binding holds.
    fn slices(&self, caps: &Caps) -> Vec<Slice> {
        let w = &self.weights;
        let fours = self.ci.is_multiple_of(4) && w.n.is_multiple_of(4);
        let shader = match (caps.tier, w.storage) {
            (Tier::Software, WeightType::F32) if fours => &shaders::SOFTWARE,
            (Tier::Software, _) if fours => &shaders::SOFTWARE_W16,
            (Tier::Gpu, storage) if fours => tile(storage, caps),
            (_, WeightType::F32) => &shaders::BASELINE,
            (_, _) => &shaders::BASELINE_W16,
        };
        // An even number of blocks: the GPU tile is two wide.
        let fit = (caps.max_binding / w.block_bytes()).max(2) as u32 / 2 * 2;
        let starts = (0..w.blocks()).step_by(fit as usize);
        let slice = |block| {
            let blocks = fit.min(w.blocks() - block);
            Slice {
                shader,
                window: W.window(u64::from(block) * w.block_bytes(), u64::from(blocks) * w.block_bytes()),
                block,
                blocks,
            }
        };
        starts.map(slice).collect()
    }

    fn dispatch(&self, piece: &Piece, slice: &Slice, caps: &Caps) -> Dispatch {
        let [ho, wo] = self.output().map(u64::from);
        let co = u64::from(self.weights.n);
        let (hi, x_row) = (u64::from(self.hi), u64::from(self.wi) * u64::from(self.ci));
        // Input rows of a band, with those its kernel reaches; all of them for whole frames.
        let (iy0, iy1) = if piece.rows == ho {
            (0, hi)
        } else {
            let (stride, pad) = (u64::from(self.stride), u64::from(self.padding));
            let end = (piece.row + piece.rows - 1) * stride + u64::from(self.kernel[0]);
            ((piece.row * stride).saturating_sub(pad).min(hi - 1), end.saturating_sub(pad).clamp(1, hi))
        };
        let x_len = ((piece.frames - 1) * hi + iy1.max(iy0 + 1) - iy0) * x_row;
        let (x, x_rest) = cover(X, (piece.frame * hi + iy0) * x_row, x_len, caps);
        let pixels = piece.frames * piece.rows * wo;
        let first = (piece.frame * ho + piece.row) * wo * co;
        let (y, y_rest) = cover(Y, first, pixels * co, caps);
        let same =
            |arg: Arg, there: bool| if there { cover(arg, first, pixels * co, caps).0 } else { Arg::ABSENT.into() };

        let params = Conv2dParams {
            pixels: pixels as u32,
            wo: wo as u32,
            frame_pixels: (piece.rows * wo) as u32,
            hi: self.hi,
            wi: self.wi,
            ci: self.ci,
            co: self.weights.n,
            kw: self.kernel[1],
            taps: self.kernel[0] * self.kernel[1],
            stride: self.stride,
            pad: self.padding,
            oy0: piece.row as u32,
            iy0: iy0 as u32,
            x_rest,
            y_rest,
            n0: slice.block * 32,
            blocks: slice.blocks,
            k_packed: self.weights.k_packed(),
            act: self.act as u32,
            flags: self.flags(),
            low: self.low(),
            group: self.weights.row_group(pixels.div_ceil(SOFTWARE_PIXELS), SOFTWARE_PIXELS * u64::from(self.ci) * 4),
            pad0: 0,
            pad1: 0,
        };
        let blocks = u64::from(slice.blocks);
        let groups = match slice.shader.variant {
            "software" | "software_w16" => pixels.div_ceil(SOFTWARE_PIXELS) * blocks,
            "baseline" | "baseline_w16" => (pixels.div_ceil(4) * blocks * 8).div_ceil(64),
            _ => pixels.div_ceil(64) * blocks.div_ceil(2),
        };
        let residual = same(RESIDUAL, self.residual);
        let residual2 = same(RESIDUAL2, self.residual2);
        let windows = [x, slice.window, BIAS.when(self.bias).into(), residual, residual2, y];
        let operations = self.operations(piece.frames * piece.rows, wo, slice.blocks);
        Dispatch::new(slice.shader, &params, &windows, groups).of_operations(operations)
    }

    /// Operations of rows of the output, some blocks of 32 channels.
    fn operations(&self, rows: u64, wo: u64, blocks: u32) -> u64 {
        2 * rows * wo * u64::from(self.weights.k) * 32 * u64::from(blocks)
    }
}

/// The GPU variant, as `linear` chooses it.
fn tile(storage: WeightType, caps: &Caps) -> &'static Shader {
    use shaders as s;
    match (storage, caps.products()) {
        (WeightType::F32, Cooperative { f32_8: true, .. }) => &s::COOPERATIVE_8,
        (WeightType::F32, _) => &s::GPU,
        (_, Cooperative { f16_16: true, .. }) if caps.f16 => &s::COOPERATIVE_16_W16,
        (_, Cooperative { f32_8: true, .. }) => &s::COOPERATIVE_8_W16,
        _ if caps.f16 => &s::GPU_F16_W16,
        _ => &s::GPU_W16,
    }
}
