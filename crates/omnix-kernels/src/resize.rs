//! Bilinear and bicubic resizing of channels-last maps, with an optional addition of position codes:
//! `y[f, oy, ox, c] = Σ_taps w_y w_x x[f, iy, ix, c] + code`, where half of the code's channels depend on the column alone and
//! half on the row: `code[ox, c]` for `c < C/2`, `code[wo + oy, c − C/2]` for the others. The whole table, C/2 · ho · wo numbers more,
//! is never made.
//!
//! Bicubic is Keys' kernel with a = −0.75; its taps outside of the map take the border's value and its source
//! coordinate is not clamped. Bilinear clamps the coordinate below at 0, and its second tap at the border. Source
//! coordinates are rational and split into cell and fraction in integers, so they are exact to f32's rounding of
//! the fraction. Each output is computed alone: splitting changes no bit.

use omnix_shaders::resize as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[frames, hi, wi, c]`.
pub const X: Arg = Arg(0);
/// Added to every frame's result, `[wo + ho, c/2]`: rows for columns, then for rows.
pub const CODE: Arg = Arg(1);
/// Output `[frames, ho, wo, c]`.
pub const Y: Arg = Arg(2);

/// Between which neighbours an output lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The two nearest cells of each axis.
    Bilinear,
    /// The four nearest cells of each axis.
    Bicubic,
}

/// A positive rational number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Ratio {
    /// Numerator.
    pub num: u32,
    /// Denominator, not 0.
    pub den: u32,
}

impl Ratio {
    /// The last convergent of `value` whose denominator is at most 4096: exact for such fractions, otherwise nearer
    /// than 1e-7 for most.
    ///
    /// # Errors
    /// When `value` is not a finite number in 0..4096 or is nearest to 0.
    pub fn approximate(value: f64) -> Result<Self, KernelError> {
        let bad = || {
            let reason =
                format!("a scale of {value} source cells an output pixel; it must lie between 1/4096 and 4096");
            KernelError::Unsupported { kernel: "resize", reason }
        };
        if !(value.is_finite() && value > 0.0 && value < 4096.0) {
            return Err(bad());
        }
        let (mut low, mut high, mut rest) = ((0u64, 1u64), (1u64, 0u64), value);
        // Two values of a 53-bit mantissa differ after 20 quotients at most at this size of denominator.
        for _ in 0..20 {
            let whole = rest.floor();
            let next = (whole as u64 * high.0 + low.0, whole as u64 * high.1 + low.1);
            if next.1 > 4096 {
                break;
            }
            (low, high) = (high, next);
            let fraction = rest - whole;
            if fraction < 1e-9 {
                break;
            }
            rest = 1.0 / fraction;
        }
        if high.0 == 0 { Err(bad()) } else { Ok(Self { num: high.0 as u32, den: high.1 as u32 }) }
    }
}

/// Where the source coordinate of output o lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Corners {
    /// Corner pixels fall on corner pixels: `o · (n_in − 1) / (n_out − 1)`, 0 where there is one output.
    Align,
    /// Pixel areas: `(o + ½) · n_in / n_out − ½`.
    HalfPixel,
    /// Pixel areas with a scale of its own, in source cells an output pixel: `(o + ½) · scale − ½`.
    HalfPixelScaled {
        /// Scale of the rows.
        rows: Ratio,
        /// Scale of the columns.
        columns: Ratio,
    },
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Resize {
    /// Independent maps.
    pub frames: u32,
    /// Input rows.
    pub hi: u32,
    /// Input columns.
    pub wi: u32,
    /// Output rows.
    pub ho: u32,
    /// Output columns.
    pub wo: u32,
    /// Channels.
    pub c: u32,
    /// Which neighbours.
    pub filter: Filter,
    /// Which coordinates.
    pub corners: Corners,
    /// Whether [`CODE`] is there; c is even then.
    pub code: bool,
}

crate::layout::params! {
    /// `Params` of `shaders/resize`.
    pub struct ResizeParams {
        pixels: u32,
        frame_pixels: u32,
        wo: u32,
        hi: u32,
        wi: u32,
        c: u32,
        y_a: u32,
        y_b: u32,
        y_d: u32,
        x_a: u32,
        x_b: u32,
        x_d: u32,
        oy0: u32,
        iy0: u32,
        x_rest: u32,
        y_rest: u32,
        code_rest: u32,
        clamp: u32,
        has_code: u32,
        lanes: u32,
    }
}

/// The source coordinate of output o: `(o·a + b) / d − 1`, the numerator never negative.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Axis {
    pub(crate) a: u64,
    pub(crate) b: u64,
    pub(crate) d: u64,
}

impl Axis {
    /// The cell at or below the coordinate of output o; −1 is possible.
    fn cell(self, o: u64) -> i64 {
        ((o * self.a + self.b) / self.d) as i64 - 1
    }
}

/// Output columns, of one or two rows, that a workgroup of the software variants owns (`STRIP` in the sidecar file).
const SOFTWARE_STRIP: u64 = 64;

impl Resize {
    /// Bytes read and written once each.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let [hi, wi, ho, wo] = [self.hi, self.wi, self.ho, self.wo].map(u64::from);
        let code = if self.code { (ho + wo) / 2 } else { 0 };
        4 * u64::from(self.c) * (u64::from(self.frames) * (hi * wi + ho * wo) + code)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a side is 0 or the channels of a code are odd, when a side is so long that the coordinates leave 32 bits (about 30,000), or
    /// when the code or one row of a map (with the rows it is computed from) is larger than the device's binding limit.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let unsupported = |reason: String| KernelError::Unsupported { kernel: "resize", reason };
        let axes = self.axes("resize")?;
        if self.code && !self.c.is_multiple_of(2) {
            return Err(unsupported(format!("a code of an odd number of channels: {self:?}")));
        }
        let code = 4 * (u64::from(self.wo) + u64::from(self.ho)) * u64::from(self.c / 2);
        if self.code && code > caps.max_binding {
            return Err(KernelError::RowTooLarge { kernel: "resize", bytes: code, limit: caps.max_binding });
        }
        let (ho, frames) = (u64::from(self.ho), u64::from(self.frames));
        let x_row = u64::from(self.wi) * u64::from(self.c);
        let y_row = u64::from(self.wo) * u64::from(self.c);
        let room = room(caps);
        let mut out = Vec::new();
        let count = room / (u64::from(self.hi) * x_row).max(ho * y_row);
        if count > 0 {
            for frame in (0..frames).step_by(count as usize) {
                out.push(self.dispatch(&axes, (frame, count.min(frames - frame)), (0, ho), caps));
            }
            return Ok(out);
        }
        for frame in 0..frames {
            let mut row = 0;
            while row < ho {
                let mut rows = (room / y_row).min(ho - row);
                let needed = |rows: u64| {
                    let [from, to] = self.input_rows(axes[0], row, rows);
                    (to - from) * x_row
                };
                while rows > 0 && needed(rows) > room {
                    rows -= rows.div_ceil(8);
                }
                if rows == 0 {
                    let bytes = 4 * y_row.max(needed(1));
                    return Err(KernelError::RowTooLarge { kernel: "resize", bytes, limit: caps.max_binding });
                }
                out.push(self.dispatch(&axes, (frame, 1), (row, rows), caps));
                row += rows;
            }
        }
        Ok(out)
    }

    /// The coordinates of rows and columns, as far as `kernel` can compute them in 32 bits.
    pub(crate) fn axes(&self, kernel: &'static str) -> Result<[Axis; 2], KernelError> {
        let unsupported = |reason: String| KernelError::Unsupported { kernel, reason };
        if [self.frames, self.hi, self.wi, self.ho, self.wo, self.c].contains(&0) {
            return Err(unsupported(format!("nothing to compute: {self:?}")));
        }
        let axes = [self.axis(self.hi, self.ho, true), self.axis(self.wi, self.wo, false)];
        for (axis, n_out) in axes.iter().zip([self.ho, self.wo]) {
            if axis.d == 0 || axis.d >= 1 << 24 || u64::from(n_out) * axis.a + axis.b > u64::from(u32::MAX) {
                return Err(unsupported(format!("sides too long: {self:?}; 16,000 pixels are safe")));
            }
        }
        Ok(axes)
    }

    fn axis(&self, n_in: u32, n_out: u32, rows: bool) -> Axis {
        let (n_in, n_out) = (u64::from(n_in), u64::from(n_out));
        // (2o + 1) p / 2q - 1/2 = (2p o + p - q) / 2q, one cell added.
        let half = |p: u64, q: u64| Axis { a: 2 * p, b: p + q, d: 2 * q };
        match self.corners {
            Corners::Align if n_out == 1 => Axis { a: 0, b: 1, d: 1 },
            Corners::Align => Axis { a: n_in - 1, b: n_out - 1, d: n_out - 1 },
            Corners::HalfPixel => half(n_in, n_out),
            Corners::HalfPixelScaled { rows: r, columns: c } => {
                let scale = if rows { r } else { c };
                half(scale.num.into(), scale.den.into())
            }
        }
    }

    /// The input rows from which output rows are computed: first, and one past the last.
    fn input_rows(&self, axis: Axis, row: u64, rows: u64) -> [u64; 2] {
        let (before, after) = match self.filter {
            Filter::Bilinear => (0, 1),
            Filter::Bicubic => (1, 2),
        };
        let last = i64::from(self.hi) - 1;
        let at = |cell: i64| cell.clamp(0, last) as u64;
        [at(axis.cell(row) - before), at(axis.cell(row + rows - 1) + after) + 1]
    }

    fn dispatch(
        &self,
        axes: &[Axis; 2],
        (frame, frames): (u64, u64),
        (row, rows): (u64, u64),
        caps: &Caps,
    ) -> Dispatch {
        let [y_axis, x_axis] = *axes;
        let [hi, wi, ho, wo, c] = [self.hi, self.wi, self.ho, self.wo, self.c].map(u64::from);
        let [iy0, iy1] = if rows == ho { [0, hi] } else { self.input_rows(y_axis, row, rows) };
        let (x, x_rest) = cover(X, (frame * hi + iy0) * wi * c, ((frames - 1) * hi + iy1 - iy0) * wi * c, caps);
        let pixels = frames * rows * wo;
        let (y, y_rest) = cover(Y, (frame * ho + row) * wo * c, pixels * c, caps);
        let (code, code_rest) =
            if self.code { cover(CODE, 0, (wo + ho) * (c / 2), caps) } else { (Arg::ABSENT.into(), 0) };
        let bilinear = self.filter == Filter::Bilinear;
        // A variant, and the channels that it takes at a time. A code changes in the middle of them.
        let parts = if self.code { 2 } else { 1 };
        let pairs = self.c.is_multiple_of(2 * parts);
        let fours = self.c.is_multiple_of(4 * parts);
        // Eights where they leave no lane idle.
        let eights = self.c.is_multiple_of(64) || self.c.is_multiple_of(8 * parts) && self.c.is_power_of_two();
        let software = caps.tier == Tier::Software;
        // Rows of output that a lane walks along; 0 where an invocation owns what it takes at a time.
        let (shader, unit, walked) = match self.filter {
            Filter::Bilinear if software && eights => (&shaders::SOFTWARE8, 8, 2),
            Filter::Bilinear if software && fours => (&shaders::SOFTWARE, 4, 2),
            Filter::Bilinear if software && pairs => (&shaders::SOFTWARE2, 2, 2),
            Filter::Bilinear if software => (&shaders::SOFTWARE1, 1, 2),
            Filter::Bilinear if fours => (&shaders::BILINEAR4, 4, 0),
            Filter::Bilinear => (&shaders::BILINEAR, 1, 0),
            // From column to column of x; where it shrinks to less than a quarter, most would be loaded for nothing.
            Filter::Bicubic if software && fours && !self.code && x_axis.a <= 4 * x_axis.d => {
                if eights {
                    (&shaders::CUBIC8, 8, 1)
                } else {
                    (&shaders::CUBIC, 4, 1)
                }
            }
            Filter::Bicubic if fours => (&shaders::BICUBIC4, 4, 0),
            Filter::Bicubic => (&shaders::BICUBIC, 1, 0),
        };
        // Lanes that share a pixel: the rest of the 8 take other rows, so that all have work.
        let units = c / u64::from(unit);
        let lanes = if units >= 8 { 8 } else { 1 << units.trailing_zeros() };
        let groups = match walked {
            0 => (pixels * c / u64::from(unit)).div_ceil(64),
            walked => (frames * rows.div_ceil(walked)).div_ceil(8 / lanes) * wo.div_ceil(SOFTWARE_STRIP),
        };
        let params = ResizeParams {
            pixels: pixels as u32,
            frame_pixels: (rows * wo) as u32,
            wo: self.wo,
            hi: self.hi,
            wi: self.wi,
            c: self.c / unit,
            y_a: y_axis.a as u32,
            y_b: y_axis.b as u32,
            y_d: y_axis.d as u32,
            x_a: x_axis.a as u32,
            x_b: x_axis.b as u32,
            x_d: x_axis.d as u32,
            oy0: row as u32,
            iy0: iy0 as u32,
            x_rest: x_rest / unit,
            y_rest: y_rest / unit,
            code_rest: code_rest / unit,
            clamp: u32::from(bilinear),
            has_code: u32::from(self.code),
            lanes: lanes as u32,
        };
        Dispatch::new(shader, &params, &[x, code, y], groups)
    }
}

#[cfg(test)]
mod tests {
    use super::Ratio;

    #[test]
    fn ratios_are_exact_where_they_can_be() {
        for (num, den) in [(1, 1), (37, 20), (370, 201), (1, 3), (3, 4096)] {
            let found = Ratio::approximate(f64::from(num) / f64::from(den)).expect("in range");
            assert_eq!(found, Ratio { num, den });
        }
        let pi = Ratio::approximate(std::f64::consts::PI).expect("in range");
        assert!((f64::from(pi.num) / f64::from(pi.den) - std::f64::consts::PI).abs() < 1e-6);
        assert!(Ratio::approximate(f64::NAN).is_err() && Ratio::approximate(1e-9).is_err());
    }
}
