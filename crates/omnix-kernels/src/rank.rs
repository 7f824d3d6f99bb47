//! The number of a given rank in each row of n: of the numbers that are not NaN, in ascending order, ranks counting from 0. NaN where
//! no number has it. −0 equals 0, and comes out as 0.
//!
//! Exact and deterministic, for rows far longer than a workgroup: integers are counted in blocks, two bits of an
//! order-preserving key in each of 16 passes, and one pass before counts what is not NaN, from which a quantile's rank
//! follows on the device.

use omnix_shaders::rank as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError};

/// Input `[rows, n]`.
pub const X: Arg = Arg(0);
/// Output `[rows]`.
pub const Y: Arg = Arg(1);
/// Scratch, u32 `[rows, 2]`.
pub const STATE: Arg = Arg(2);
/// Scratch, u32 `[rows, blocks, 4]`; see [`Rank::blocks`].
pub const COUNTS: Arg = Arg(3);

/// Which rank.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Which {
    /// This one.
    At(u32),
    /// `numerator / denominator` of the way through the N numbers that are not NaN: `(N − 1) · numerator / denominator`, rounded,
    /// half to even. Both below 65,536.
    Quantile {
        /// At most the denominator.
        numerator: u32,
        /// Not 0.
        denominator: u32,
    },
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Rank {
    /// Independent rows.
    pub rows: u32,
    /// Numbers of a row.
    pub n: u32,
    /// The wanted rank.
    pub which: Which,
}

crate::layout::params! {
    /// `Params` of `shaders/rank`.
    pub struct RankParams {
        rows: u32,
        n: u32,
        block: u32,
        blocks: u32,
        shift: u32,
        flags: u32,
        numerator: u32,
        denominator: u32,
        x_rest: u32,
        state_rest: u32,
        counts_rest: u32,
        y_rest: u32,
    }
}

const VALID: u32 = 1;
const LAST: u32 = 2;
const QUANTILE: u32 = 4;
/// Numbers of a block.
const BLOCK: u64 = 4096;
/// Readings of x.
const PASSES: u64 = 17;

/// A pass: bits below those it finds, and what is particular about it.
#[derive(Clone, Copy)]
struct Pass {
    shift: u32,
    flags: u32,
}

impl Rank {
    /// Blocks of a row.
    #[must_use]
    pub const fn blocks(&self) -> u32 {
        self.n.div_ceil(BLOCK as u32)
    }

    /// Bytes read: the 17 readings of x.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        4 * u64::from(self.rows) * PASSES * u64::from(self.n)
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When there are no rows or numbers, a quantile is not from 0 to 1, or the device binds less than a block or the counts of a row.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        let kernel = "rank";
        if self.rows == 0 || self.n == 0 {
            let reason = format!("{} rows of {} numbers; neither may be 0", self.rows, self.n);
            return Err(KernelError::Unsupported { kernel, reason });
        }
        if let Which::Quantile { numerator, denominator } = self.which
            && (denominator == 0 || numerator > denominator || denominator > 65_535)
        {
            let reason = format!("quantile {numerator}/{denominator}; it is from 0 to 1 in parts of at most 65535");
            return Err(KernelError::Unsupported { kernel, reason });
        }
        let least = (BLOCK.min(u64::from(self.n))).max(4 * u64::from(self.blocks()));
        if least > room(caps) {
            return Err(KernelError::RowTooLarge { kernel, bytes: least * 4, limit: caps.max_binding });
        }
        let digits = (0..16).rev().map(|digit| Pass { shift: digit * 2, flags: if digit == 0 { LAST } else { 0 } });
        let mut out = Vec::new();
        for pass in std::iter::once(Pass { shift: 0, flags: VALID }).chain(digits) {
            self.count(pass, caps, &mut out);
            self.choose(pass, caps, &mut out);
        }
        Ok(out)
    }

    fn params(&self, pass: Pass) -> RankParams {
        let (numerator, denominator, quantile) = match self.which {
            Which::At(rank) => (rank, 1, 0),
            Which::Quantile { numerator, denominator } => (numerator, denominator, QUANTILE),
        };
        RankParams {
            rows: 1,
            n: self.n,
            block: BLOCK as u32,
            blocks: self.blocks(),
            shift: pass.shift,
            flags: pass.flags | quantile,
            numerator,
            denominator,
            x_rest: 0,
            state_rest: 0,
            counts_rest: 0,
            y_rest: 0,
        }
    }

    /// Whole rows at a time, or blocks of one.
    fn count(&self, pass: Pass, caps: &Caps, out: &mut Vec<Dispatch>) {
        let (rows, n, blocks, room) = (u64::from(self.rows), u64::from(self.n), u64::from(self.blocks()), room(caps));
        let fit = (room / n.max(4 * blocks)).min(rows);
        let (rows_at, length) = if fit > 0 { (fit, n) } else { (1, room / BLOCK * BLOCK) };
        for row in (0..rows).step_by(rows_at as usize) {
            for first in (0..n).step_by(length as usize) {
                let (count, len) = (rows_at.min(rows - row), length.min(n - first));
                let blocks_at = len.div_ceil(BLOCK);
                let (x, x_rest) = cover(X, row * n + first, (count - 1) * n + len, caps);
                let (state, state_rest) = cover(STATE, row * 2, count * 2, caps);
                let to = (row * blocks + first / BLOCK) * 4;
                let (counts, counts_rest) = cover(COUNTS, to, count * blocks_at * 4, caps);
                let params = RankParams {
                    rows: count as u32,
                    n: len as u32,
                    blocks: blocks_at as u32,
                    x_rest,
                    state_rest,
                    counts_rest,
                    ..self.params(pass)
                };
                let dispatch = Dispatch::new(&shaders::COUNT, &params, &[x, state, counts], count * blocks_at);
                // To order a number and to count it takes about fifteen.
                out.push(dispatch.of_operations(count * len * 15));
            }
        }
    }

    fn choose(&self, pass: Pass, caps: &Caps, out: &mut Vec<Dispatch>) {
        let (rows, blocks) = (u64::from(self.rows), u64::from(self.blocks()));
        let fit = (room(caps) / (4 * blocks)).min(rows);
        for row in (0..rows).step_by(fit as usize) {
            let count = fit.min(rows - row);
            let (counts, counts_rest) = cover(COUNTS, row * blocks * 4, count * blocks * 4, caps);
            let (state, state_rest) = cover(STATE, row * 2, count * 2, caps);
            let (y, y_rest) = cover(Y, row, count, caps);
            let params = RankParams { rows: count as u32, state_rest, counts_rest, y_rest, ..self.params(pass) };
            out.push(Dispatch::new(&shaders::CHOOSE, &params, &[counts, state, y], count));
        }
    }
}
