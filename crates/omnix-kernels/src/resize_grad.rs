//! Gradient of [`crate::resize`]: `dx[f, iy, ix, c] = Σ_oy w(oy, iy) Σ_ox w(ox, ix) dy[f, oy, ox, c]` over the outputs that read a
//! pixel, in order. A code is constant and has no gradient.
//!
//! The outputs that read a cell are a range that follows from the rational coordinates, so every pixel gathers what belongs to it:
//! splitting changes no bit.

use omnix_shaders::resize_grad as shaders;

use crate::cover::{cover, room, unit};
use crate::resize::{Axis, Filter, Resize};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Gradient of the output `[frames, ho, wo, c]`.
pub const DY: Arg = Arg(0);
/// Output `[frames, hi, wi, c]`.
pub const DX: Arg = Arg(1);

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ResizeGrad {
    /// The call whose gradient it is; its code does not matter.
    pub resize: Resize,
}

crate::layout::params! {
    /// `Params` of `shaders/resize_grad`.
    pub struct ResizeGradParams {
        pixels: u32,
        frame_pixels: u32,
        hi: u32,
        wi: u32,
        ho: u32,
        wo: u32,
        c: u32,
        y_a: u32,
        y_b: u32,
        y_d: u32,
        x_a: u32,
        x_b: u32,
        x_d: u32,
        iy0: u32,
        oy0: u32,
        dx_rest: u32,
        dy_rest: u32,
        pad0: u32,
        pad1: u32,
        pad2: u32,
    }
}

const KERNEL: &str = "resize_grad";

impl ResizeGrad {
    /// Bytes read and written once each.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        Resize { code: false, ..self.resize }.bytes()
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a side is 0 or so long that the coordinates leave 32 bits (about 30,000), or one row of a map, with the rows it is computed
    /// from, is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let spec = &self.resize;
        let axes = spec.axes(KERNEL)?;
        for (axis, n_in) in axes.iter().zip([spec.hi, spec.wi]) {
            if (u64::from(n_in) + 3) * axis.d > u64::from(u32::MAX) {
                let reason = format!("sides too long: {spec:?}; 16,000 pixels are safe");
                return Err(KernelError::Unsupported { kernel: KERNEL, reason });
            }
        }
        let (hi, frames) = (u64::from(spec.hi), u64::from(spec.frames));
        let dx_row = u64::from(spec.wi) * u64::from(spec.c);
        let dy_row = u64::from(spec.wo) * u64::from(spec.c);
        let room = room(caps);
        let mut out = Vec::new();
        let count = room / (hi * dx_row).max(u64::from(spec.ho) * dy_row);
        if count > 0 {
            for frame in (0..frames).step_by(count as usize) {
                out.push(self.dispatch(&axes, (frame, count.min(frames - frame)), (0, hi), caps));
            }
            return Ok(out);
        }
        for frame in 0..frames {
            let mut row = 0;
            while row < hi {
                let mut rows = (room / dx_row).min(hi - row);
                let needed = |rows: u64| {
                    let [start, end] = self.output_rows(axes[0], row, rows);
                    (end - start) * dy_row
                };
                while rows > 0 && needed(rows) > room {
                    rows -= rows.div_ceil(8);
                }
                if rows == 0 {
                    let bytes = 4 * dx_row.max(needed(1));
                    return Err(KernelError::RowTooLarge { kernel: KERNEL, bytes, limit: caps.max_binding });
                }
                out.push(self.dispatch(&axes, (frame, 1), (row, rows), caps));
                row += rows;
            }
        }
        Ok(out)
    }

    /// The output rows that read some input rows: first, and one past the last; at least one.
    fn output_rows(&self, axis: Axis, row: u64, rows: u64) -> [u64; 2] {
        let (before, after) = match self.resize.filter {
            Filter::Bilinear => (0, 1),
            Filter::Bicubic => (1, 2),
        };
        let (hi, ho) = (u64::from(self.resize.hi), u64::from(self.resize.ho));
        // The first output whose cell is at least t - 1.
        let reach = |t: u64| match (t * axis.d).saturating_sub(axis.b) {
            0 => 0,
            _ if axis.a == 0 => ho,
            far => far.div_ceil(axis.a).min(ho),
        };
        let start = if row == 0 { 0 } else { reach((row + 1).saturating_sub(after)) };
        let end = if row + rows == hi { ho } else { reach(row + rows + before + 1) };
        let start = start.min(ho - 1);
        [start, end.max(start + 1)]
    }

    fn dispatch(
        &self,
        axes: &[Axis; 2],
        (frame, frames): (u64, u64),
        (row, rows): (u64, u64),
        caps: &Caps,
    ) -> Dispatch {
        let spec = &self.resize;
        let [y_axis, x_axis] = *axes;
        let [hi, wi, ho, wo, c] = [spec.hi, spec.wi, spec.ho, spec.wo, spec.c].map(u64::from);
        let [oy0, oy1] = if rows == hi { [0, ho] } else { self.output_rows(y_axis, row, rows) };
        let (dy, dy_rest) = cover(DY, (frame * ho + oy0) * wo * c, ((frames - 1) * ho + oy1 - oy0) * wo * c, caps);
        let pixels = frames * rows * wi;
        let (dx, dx_rest) = cover(DX, (frame * hi + row) * wi * c, pixels * c, caps);
        let bilinear = spec.filter == Filter::Bilinear;
        let all = if bilinear {
            [&shaders::BILINEAR, &shaders::BILINEAR4, &shaders::BILINEAR_SOFTWARE]
        } else {
            [&shaders::BICUBIC, &shaders::BICUBIC4, &shaders::BICUBIC_SOFTWARE]
        };
        let (shader, width) = match caps.tier {
            Tier::Software if spec.c.is_multiple_of(8) && bilinear => (&shaders::BILINEAR_SOFTWARE8, 8),
            Tier::Software if spec.c.is_multiple_of(8) => (&shaders::BICUBIC_SOFTWARE8, 8),
            _ => unit(caps, spec.c.is_multiple_of(4), all),
        };
        let params = ResizeGradParams {
            pixels: pixels as u32,
            frame_pixels: (rows * wi) as u32,
            hi: spec.hi,
            wi: spec.wi,
            ho: spec.ho,
            wo: spec.wo,
            c: spec.c / width,
            y_a: y_axis.a as u32,
            y_b: y_axis.b as u32,
            y_d: y_axis.d as u32,
            x_a: x_axis.a as u32,
            x_b: x_axis.b as u32,
            x_d: x_axis.d as u32,
            iy0: row as u32,
            oy0: oy0 as u32,
            dx_rest: dx_rest / width,
            dy_rest: dy_rest / width,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        Dispatch::new(shader, &params, &[dy, dx], (pixels * c / u64::from(width)).div_ceil(64))
    }
}
