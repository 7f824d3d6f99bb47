//! `y[outer, inner] = op_n x[outer, n, inner]`: reduction over one axis.
//!
//! Up to [`LONGEST`] elements are summed in order by one invocation. A longer axis is cut into blocks of a fixed length, whose
//! results are reduced in the same way, until few are left: the order follows from n alone, so that splitting at binding limits
//! changes no bit. With NaN among the inputs the sums are NaN, and which number a maximum or minimum gives is up to the
//! device.

use omnix_shaders::reduce as shaders;

use crate::cover::{cover, room};
use crate::{Arg, Caps, Dispatch, KernelError, Tier};

/// Input `[outer, n, inner]`.
pub const X: Arg = Arg(0);
/// Output `[outer, inner]`.
pub const Y: Arg = Arg(1);
/// Scratch for the results of blocks, of the first of [`Reduce::scratch`] words; absent where that is 0.
pub const PARTS: Arg = Arg(2);
/// Scratch for the results of blocks of those, of the second of [`Reduce::scratch`] words; absent where that is 0.
pub const MORE: Arg = Arg(3);

/// The longest axis that is reduced in one piece; standard deviations are always.
pub const LONGEST: u32 = 1024;
/// Elements of a block of a row, and of a block of columns side by side (inner above 1).
const ROW_BLOCK: u64 = 1024;
const COLUMN_BLOCK: u64 = 256;
/// As many blocks are left to one invocation.
const FEW: u64 = 64;

/// How numbers are joined; `shaders/reduce` has the same order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u32)]
pub enum ReduceOp {
    /// The sum.
    Sum = 0,
    /// The sum divided by n.
    Mean = 1,
    /// The largest.
    Max = 2,
    /// The smallest.
    Min = 3,
    /// The standard deviation with divisor n − 1; 0 for n = 1.
    Std = 4,
}

/// What to compute.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reduce {
    /// Product of the axes before the reduced one.
    pub outer: u32,
    /// The reduced axis.
    pub n: u32,
    /// Product of the axes after it.
    pub inner: u32,
    /// The operation.
    pub op: ReduceOp,
}

crate::layout::params! {
    /// `Params` of `shaders/reduce`.
    pub struct ReduceParams {
        outer: u32,
        n: u32,
        inner: u32,
        op: u32,
        x_skip: u32,
        y_skip: u32,
        block: u32,
        parts: u32,
        width: u32,
        divisor: u32,
        flags: u32,
        pad0: u32,
    }
}

const GO_ON: u32 = 1;
/// Outputs of a workgroup.
const GROUP: u64 = 64;

/// One pass over an axis: `[outer, n, inner]` to `[outer, n / block, inner]`.
#[derive(Clone, Copy)]
struct Stage {
    from: Arg,
    to: Arg,
    n: u64,
    block: u64,
    op: ReduceOp,
}

/// A part of a pass: whole rows of outer, or elements and columns of one.
#[derive(Clone, Copy)]
struct Piece {
    outer: (u64, u64),
    elements: (u64, u64),
    columns: (u64, u64),
}

impl Reduce {
    /// Bytes of x and y, once each.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        4 * self.outer as u64 * self.inner as u64 * (self.n as u64 + 1)
    }

    /// Words of [`PARTS`] and [`MORE`].
    #[must_use]
    pub fn scratch(&self) -> [u64; 2] {
        let words = |stage: Option<&Stage>| {
            stage.map_or(0, |s| s.n.div_ceil(s.block) * u64::from(self.outer) * u64::from(self.inner))
        };
        let stages = self.stages();
        let blocks = &stages[..stages.len() - 1];
        [words(blocks.first()), words(blocks.get(1))]
    }

    /// The passes: none but the last where the axis is short.
    fn stages(&self) -> Vec<Stage> {
        let (mut n, mut from) = (u64::from(self.n), X);
        let mut stages = Vec::new();
        if self.n > LONGEST && self.op != ReduceOp::Std {
            let block = if self.inner == 1 { ROW_BLOCK } else { COLUMN_BLOCK };
            // Their sum is divided in the last pass.
            let op = if self.op == ReduceOp::Mean { ReduceOp::Sum } else { self.op };
            while n > FEW {
                let to = if from == PARTS { MORE } else { PARTS };
                stages.push(Stage { from, to, n, block, op });
                (n, from) = (n.div_ceil(block), to);
            }
        }
        stages.push(Stage { from, to: Y, n, block: n, op: self.op });
        stages
    }

    /// The dispatches that compute this on a device with `caps`.
    ///
    /// # Errors
    /// When a size is 0, or the device binds too little: not even one number, a block of a long row, or for standard
    /// deviations all `n · inner` numbers.
    pub fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        if self.outer == 0 || self.n == 0 || self.inner == 0 {
            let reason = format!("x is [{}, {}, {}]; no axis may be 0", self.outer, self.n, self.inner);
            return Err(KernelError::Unsupported { kernel: "reduce", reason });
        }
        let mut out = Vec::new();
        for stage in self.stages() {
            self.pass(&stage, caps, &mut out)?;
        }
        Ok(out)
    }

    fn pass(&self, stage: &Stage, caps: &Caps, out: &mut Vec<Dispatch>) -> Result<(), KernelError> {
        let (outer, inner, n) = (u64::from(self.outer), u64::from(self.inner), stage.n);
        let limit = caps.max_binding;
        let x_row = n * inner * 4;
        // Where rows are split, a binding starts up to one alignment step before its first row.
        let rows = if outer * x_row <= limit { outer } else { limit.saturating_sub(caps.align) / x_row };
        if rows > 0 {
            for first in (0..outer).step_by(rows as usize) {
                let piece = Piece { outer: (first, rows.min(outer - first)), elements: (0, n), columns: (0, inner) };
                out.push(self.dispatch(stage, &piece, caps));
            }
            return Ok(());
        }
        let (room, block) = (room(caps), stage.block);
        let by_row = inner == 1 && block < n;
        if room == 0 || self.op == ReduceOp::Std || by_row && block > room {
            let bytes = if by_row { block * 4 } else { x_row } + caps.align;
            return Err(KernelError::RowTooLarge { kernel: "reduce", bytes, limit });
        }
        // Several blocks, or some elements of one, or some columns of one element.
        let width = room.min(inner);
        let elements = if block * inner <= room { room / (block * inner) * block } else { (room / inner).max(1) };
        for o in 0..outer {
            let mut first = 0;
            while first < n {
                let block_end = if elements < block { first / block * block + block } else { n };
                let count = elements.min(block_end.min(n) - first);
                for column in (0..inner).step_by(width as usize) {
                    let columns = (column, width.min(inner - column));
                    out.push(self.dispatch(stage, &Piece { outer: (o, 1), elements: (first, count), columns }, caps));
                }
                first += count;
            }
        }
        Ok(())
    }

    fn dispatch(&self, stage: &Stage, piece: &Piece, caps: &Caps) -> Dispatch {
        let Stage { from, to, n, block, op } = *stage;
        let inner = u64::from(self.inner);
        let ((o, outer), (first, count), (column, width)) = (piece.outer, piece.elements, piece.columns);
        let (all_parts, parts) = (n.div_ceil(block), count.div_ceil(block));
        let x_first = (o * n + first) * inner + column;
        let (x, x_skip) = cover(from, x_first, (outer * count - 1) * inner + width, caps);
        let y_first = (o * all_parts + first / block) * inner + column;
        let (y, y_skip) = cover(to, y_first, (outer * parts - 1) * inner + width, caps);
        // A mean is divided when its last element has been added.
        let last = first + count == n || (first + count).is_multiple_of(block);
        let op = if op == ReduceOp::Mean && !last { ReduceOp::Sum } else { op };
        let go_on = !first.is_multiple_of(block);
        let params = ReduceParams {
            outer: outer as u32,
            n: count as u32,
            inner: self.inner,
            op: op as u32,
            x_skip,
            y_skip,
            block: block as u32,
            parts: parts as u32,
            width: width as u32,
            divisor: self.n,
            flags: if go_on { GO_ON } else { 0 },
            pad0: 0,
        };
        if inner == 1 && block < n {
            let fours = n.is_multiple_of(4) && op == ReduceOp::Sum && caps.tier == Tier::Software;
            let shader = if fours { &shaders::SOFTWARE_ROWS } else { &shaders::ROWS };
            return Dispatch::new(shader, &params, &[x, y], outer * parts);
        }
        let fours = inner.is_multiple_of(4) && width.is_multiple_of(4) && column.is_multiple_of(4);
        if fours && block < n && caps.tier == Tier::Software {
            let groups = (outer * parts * width / 4).div_ceil(8);
            return Dispatch::new(&shaders::SOFTWARE_COLUMNS, &params, &[x, y], groups);
        }
        Dispatch::new(&shaders::BASELINE, &params, &[x, y], (outer * parts * width).div_ceil(GROUP))
    }
}
