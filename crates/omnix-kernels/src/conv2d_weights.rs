//! `dw[o, c, ky, kx] = Σ_{f, oy, ox} dy[f, oy, ox, o] · x[f, oy s + ky − pad, ox s + kx − pad, c]` and, where wanted,
//! `db[o] = Σ dy[f, oy, ox, o]`: the gradients of [`crate::conv2d`]'s weights, in the order that checkpoints have them, and bias.
//!
//! The output rows of all frames are cut into sections of whole parts (`sections.rs`), a part is as many rows as have 64 pixels. A part
//! is summed pixel by pixel, parts are joined in order; sections wait in [`PARTS`] and are added in order at the end. The cuts follow
//! from the shape alone: splitting at the binding limit changes no bit.

use omnix_shaders::{Shader, conv2d_weights as shaders};

use crate::cover::{cover, room};
use crate::dispatch::round_up;
use crate::linear_weights::{column_sums, column_words};
use crate::sections::{Run, Sections};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// The convolution's input `[frames, hi, wi, ci]`.
pub const X: Arg = Arg(0);
/// Gradient of its output `[frames, ho, wo, co]`.
pub const DY: Arg = Arg(1);
/// Output `[co, ci, kh, kw]`.
pub const DW: Arg = Arg(2);
/// Output `[co]`.
pub const DB: Arg = Arg(3);
/// Scratch of [`Conv2dWeights::parts_words`] numbers.
pub const PARTS: Arg = Arg(4);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Conv2dWeights {
    /// Independent maps.
    pub frames: u32,
    /// Input rows.
    pub hi: u32,
    /// Input columns.
    pub wi: u32,
    /// Input channels.
    pub ci: u32,
    /// Output channels.
    pub co: u32,
    /// Rows and columns of the kernel.
    pub kernel: [u32; 2],
    /// Input pixels between neighbouring outputs, both ways.
    pub stride: u32,
    /// Zero rows and columns on every side.
    pub padding: u32,
    /// Whether [`DB`] is there.
    pub bias: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/conv2d_weights`.
    #[derive(Default)]
    pub struct Conv2dWeightsParams {
        rows: u32,
        section: u32,
        part: u32,
        wo: u32,
        ho: u32,
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
        dy_rest: u32,
        out_rest: u32,
        out_step: u32,
        n_tiles: u32,
        k_tiles: u32,
        count: u32,
        len: u32,
        flags: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
        pad3: u32,
    }
}

const KERNEL: &str = "conv2d_weights";
const GO_ON: u32 = 1;
/// A part has the rows of this number of pixels, or one row.
const PART_PIXELS: u64 = 64;
/// Tiles of 32 x 32 sums that keep a large GPU busy; a processor needs fewer. Below that the rows are cut.
const TILES: u64 = 1024;
/// A section has at least the rows of this number of pixels, but the last one.
const LEAST_PIXELS: u64 = 256;
/// Pixels of a longer section that a dispatch sums on software devices: what its tiles read again stays in a cache.
const SOFTWARE_PIXELS: u64 = 1024;

impl Conv2dWeights {
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
        let [ho, wo] = self.output().map(u64::from);
        2 * u64::from(self.frames) * ho * wo * self.words()
    }

    /// 32-bit words of [`PARTS`].
    #[must_use]
    pub fn parts_words(&self) -> u64 {
        let [ho, wo] = self.output().map(u64::from);
        let bias = if self.bias { column_words(u64::from(self.frames) * ho * wo, self.co.into()) } else { 0 };
        self.bias_start() + bias
    }

    /// Numbers of [`DW`].
    fn words(&self) -> u64 {
        self.taps() * u64::from(self.co) * u64::from(self.ci)
    }

    fn taps(&self) -> u64 {
        u64::from(self.kernel[0]) * u64::from(self.kernel[1])
    }

    /// Where the sums of [`DB`] begin in [`PARTS`].
    fn bias_start(&self) -> u64 {
        round_up(self.sections().count() * self.words(), 64)
    }

    /// Rows of a part.
    fn part(&self) -> u64 {
        PART_PIXELS.div_ceil(u64::from(self.output()[1]).max(1))
    }

    fn sections(&self) -> Sections {
        let [ho, wo] = self.output().map(u64::from);
        let tiles = u64::from(self.co).div_ceil(32) * u64::from(self.ci).div_ceil(32) * self.taps();
        let least = LEAST_PIXELS.div_ceil(wo.max(1));
        Sections::new(u64::from(self.frames) * ho, self.part(), TILES.div_ceil(tiles.max(1)), least)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When there is nothing to compute, or the weights, or the maps' rows of one part (with those the kernel reaches), are larger
    /// than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let [ho, wo] = self.output().map(u64::from);
        if self.frames == 0 || self.words() == 0 || ho == 0 || wo == 0 {
            let reason = format!("nothing to compute: {self:?}");
            return Err(KernelError::Unsupported { kernel: KERNEL, reason });
        }
        let step = self.words();
        if step > room(caps) {
            return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes: step * 4, limit: caps.max_binding });
        }
        let sections = self.sections();
        let (shader, tile) = self.variant(caps);
        let mut out = Vec::new();
        for run in self.runs(caps)? {
            out.push(self.dispatch(shader, tile, &sections, run, caps));
        }
        // Sections that one binding holds.
        let together = ((room(caps) - step) / step + 1).min(sections.count());
        for section in (0..sections.count()).step_by(together as usize) {
            let count = together.min(sections.count() - section);
            let (sums, x_rest) = cover(PARTS, section * step, count * step, caps);
            let params = Conv2dWeightsParams {
                ci: self.ci,
                co: self.co,
                taps: self.taps() as u32,
                x_rest,
                out_step: step as u32,
                count: count as u32,
                len: step as u32,
                flags: if section > 0 { GO_ON } else { 0 },
                ..Conv2dWeightsParams::default()
            };
            out.push(Dispatch::new(&shaders::TURN, &params, &[sums, DW.into()], step.div_ceil(64)));
        }
        if self.bias {
            let shape = [u64::from(self.frames) * ho * wo, u64::from(self.co)];
            column_sums(KERNEL, (DY, shape), (PARTS, self.bias_start()), DB, caps, &mut out)?;
        }
        Ok(out)
    }

    /// Runs of output rows whose maps fit into a binding and whose products into a dispatch.
    fn runs(&self, caps: &Caps) -> Result<Vec<Run>, KernelError> {
        let (sections, part, room, step) = (self.sections(), self.part(), room(caps), self.words());
        let wo = u64::from(self.output()[1]);
        let dy_row = wo * u64::from(self.co);
        let x_row = u64::from(self.wi) * u64::from(self.ci);
        let padded = |n: u32| u64::from(n.next_multiple_of(64));
        let short = caps.max_operations() / (2 * wo * self.taps() * padded(self.co) * padded(self.ci));
        let mut fit = (room / dy_row).min(short.max(part));
        if caps.tier == Tier::Software && sections.each * wo > SOFTWARE_PIXELS {
            fit = fit.min((SOFTWARE_PIXELS / wo).max(part));
        }
        // Longer than all rows is as good as all, and counts in parts.
        fit = fit.min(sections.rows.next_multiple_of(part)) / part * part;
        let most = (room - step) / step + 1;
        while fit > 0 {
            let runs = sections.runs(fit, most);
            let reached = |run: &Run| {
                let (first, end) = self.input_rows(run.row0, run.rows);
                (end - first) * x_row
            };
            if runs.iter().all(|run| reached(run) <= room) {
                return Ok(runs);
            }
            fit = fit / 2 / part * part;
        }
        let (first, end) = self.input_rows(0, part.min(sections.rows));
        let bytes = 4 * (part * dy_row).max((end - first) * x_row);
        Err(KernelError::RowTooLarge { kernel: KERNEL, bytes, limit: caps.max_binding })
    }

    /// The rows of x, over all frames, that output rows are computed from: first, and one past the last; at least one.
    fn input_rows(&self, row0: u64, rows: u64) -> (u64, u64) {
        let (ho, hi) = (u64::from(self.output()[0]), u64::from(self.hi));
        let (stride, pad) = (u64::from(self.stride), u64::from(self.padding));
        let place = |row: u64, reach: u64| row / ho * hi + (row % ho * stride + reach).saturating_sub(pad).min(hi);
        let first = place(row0, 0).min(row0 / ho * hi + hi - 1);
        (first, place(row0 + rows - 1, u64::from(self.kernel[0])).max(first + 1))
    }

    /// The variant, and the channels of a tile.
    fn variant(&self, caps: &Caps) -> (&'static Shader, u64) {
        let fours = self.ci.is_multiple_of(4) && self.co.is_multiple_of(4);
        match caps.tier {
            Tier::Software if fours => (&shaders::SOFTWARE, 32),
            Tier::Gpu if fours => (&shaders::GPU, 64),
            _ => (&shaders::BASELINE, 4),
        }
    }

    fn dispatch(&self, shader: &'static Shader, tile: u64, sections: &Sections, run: Run, caps: &Caps) -> Dispatch {
        let [ho, wo] = self.output().map(u64::from);
        let [hi, wi, ci, co] = [self.hi, self.wi, self.ci, self.co].map(u64::from);
        let step = self.words();
        let (first, end) = self.input_rows(run.row0, run.rows);
        let (x, x_rest) = cover(X, first * wi * ci, (end - first) * wi * ci, caps);
        let (dy, dy_rest) = cover(DY, run.row0 * wo * co, run.rows * wo * co, caps);
        let (target, out_rest) = cover(PARTS, run.section * step, run.sections * step, caps);
        let (n_tiles, k_tiles) = (co.div_ceil(tile), ci.div_ceil(tile));
        let params = Conv2dWeightsParams {
            rows: run.rows as u32,
            section: sections.each as u32,
            part: self.part() as u32,
            wo: wo as u32,
            ho: ho as u32,
            hi: self.hi,
            wi: self.wi,
            ci: self.ci,
            co: self.co,
            kw: self.kernel[1],
            taps: self.taps() as u32,
            stride: self.stride,
            pad: self.padding,
            oy0: (run.row0 % ho) as u32,
            iy0: (first - run.row0 / ho * hi) as u32,
            x_rest,
            dy_rest,
            out_rest,
            out_step: step as u32,
            n_tiles: n_tiles as u32,
            k_tiles: k_tiles as u32,
            flags: if run.go_on { GO_ON } else { 0 },
            ..Conv2dWeightsParams::default()
        };
        let tiles = n_tiles * k_tiles * self.taps() * run.sections;
        let groups = if tile == 4 { tiles.div_ceil(64) } else { tiles };
        let operations = 2 * run.rows * wo * n_tiles * k_tiles * self.taps() * tile * tile;
        Dispatch::new(shader, &params, &[x, dy, target], groups).of_operations(operations)
    }
}
