//! Cases of `copy`.

use omnix_kernels::copy::{Copy, Strided, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};

/// A copy between tensors of these lengths.
#[derive(Clone, Copy, Debug)]
pub struct Between {
    /// The specification.
    pub spec: Copy,
    /// Words of x.
    pub x: usize,
    /// Words of y.
    pub y: usize,
}

impl Call for Between {
    fn kernel(&self) -> &'static str {
        "copy"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.spec.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let x = (0..self.x as u32).map(|i| i.wrapping_mul(0x9e37_79b9)).collect();
        vec![Values::U32(x), Values::Out(self.y)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        // What is not addressed keeps the bits that it had.
        let mut y = vec![0xffff_ffff; self.y];
        cpu::copy(&self.spec, args[0].u32(), &mut y);
        vec![(Y, Values::U32(y))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        0.0
    }

    fn work(&self) -> Work {
        Work::Bytes(self.spec.bytes())
    }
}

/// The permutation `order` of a contiguous `shape`, outermost first; written contiguously.
#[must_use]
pub fn permutation(shape: [u32; 6], order: [usize; 6]) -> Between {
    let from = Strided::contiguous(shape);
    let size = shape.iter().map(|&n| n as usize).product();
    let shape = order.map(|d| shape[d]);
    let src = Strided { offset: 0, strides: order.map(|d| from.strides[d]) };
    Between { spec: Copy { shape, src, dst: Strided::contiguous(shape) }, x: size, y: size }
}

/// Permutations and whole copies; slices, concatenations and broadcasts, which leave the rest alone; blocks to space and back.
fn tests() -> Vec<Between> {
    let shapes = [
        [1; 6],
        [1, 1, 1, 1, 1, 1000],
        [2, 3, 4, 5, 6, 7],
        [1, 1, 3, 20, 36, 64],
        [1, 1, 1, 65, 33, 3],
        [5, 1, 2, 1, 9, 8],
    ];
    let orders = [[0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0], [0, 1, 3, 2, 4, 5], [1, 0, 2, 3, 5, 4], [0, 5, 3, 4, 1, 2]];
    let mut cases: Vec<Between> =
        shapes.into_iter().flat_map(|shape| orders.map(|order| permutation(shape, order))).collect();
    // Channels 3..8 of [7, 9, 11] into channels 2..7 of [7, 9, 13], and the aligned neighbour.
    for (width, from, count, wide, to) in [(11, 3, 5, 13, 2), (16, 4, 8, 32, 24), (64, 0, 64, 128, 64), (6, 2, 4, 8, 4)]
    {
        let spec = Copy {
            shape: [1, 1, 1, 7, 9, count],
            src: Strided { offset: from, strides: [0, 0, 0, 9 * width, width, 1] },
            dst: Strided { offset: to, strides: [0, 0, 0, 9 * wide, wide, 1] },
        };
        cases.push(Between { spec, x: 63 * width as usize, y: 63 * wide as usize + 5 });
    }
    // A row of 12 repeated over 5 x 3 rows; a single number repeated 37 times.
    let row = Copy {
        shape: [1, 1, 1, 5, 3, 12],
        src: Strided { offset: 0, strides: [0, 0, 0, 0, 0, 1] },
        dst: Strided { offset: 0, strides: [0, 0, 0, 36, 12, 1] },
    };
    cases.push(Between { spec: row, x: 12, y: 180 });
    let number = Copy {
        shape: [1, 1, 1, 1, 1, 37],
        src: Strided { offset: 2, strides: [0; 6] },
        dst: Strided { offset: 1, strides: [0, 0, 0, 0, 0, 1] },
    };
    cases.push(Between { spec: number, x: 3, y: 40 });
    // [h, w, i, j, c] of a transposed convolution to [h i, w j, c]; an image [h p, w p, 3] to patches [h, w, p, p, 3].
    cases.push(permutation([1, 5, 6, 2, 2, 12], [0, 1, 3, 2, 4, 5]));
    cases.push(permutation([1, 4, 14, 5, 14, 3], [0, 1, 3, 2, 4, 5]));
    cases
}

/// Tests; then the permutations, concatenations and rearrangements of the networks.
#[must_use]
pub fn cases() -> Vec<Case> {
    let half = Copy {
        shape: [1, 1, 1, 1, 5760, 384],
        src: Strided::contiguous([1, 1, 1, 1, 5760, 384]),
        dst: Strided { offset: 384, strides: [0, 0, 0, 0, 768, 1] },
    };
    let half = Between { spec: half, x: 5760 * 384, y: 2 * 5760 * 384 };
    let benches = [
        ("whole 4M", permutation([1, 1, 1, 1, 1, 1 << 22], [0, 1, 2, 3, 4, 5])),
        ("concatenate 5760x384 of 768", half),
        ("depth to space 20x36x4x4x48 x8", permutation([8, 20, 36, 4, 4, 48], [0, 1, 3, 2, 4, 5])),
        ("heads to tokens 6x5760x64", permutation([1, 1, 1, 6, 5760, 64], [0, 1, 2, 4, 3, 5])),
        ("patches 280x504x3", permutation([1, 20, 14, 36, 14, 3], [0, 1, 3, 2, 4, 5])),
        ("transpose 2000x1000", permutation([1, 1, 1, 1, 2000, 1000], [0, 1, 2, 3, 5, 4])),
    ];
    let benches = benches.map(|(name, call)| Case::bench(name, call));
    tests().into_iter().map(Case::test).chain(benches).collect()
}
