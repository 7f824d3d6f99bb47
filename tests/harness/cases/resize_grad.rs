//! Cases of `resize_grad`.

use omnix_kernels::resize::{Corners, Filter, Resize};
use omnix_kernels::resize_grad::{DX, ResizeGrad};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::resize::corners;
use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for ResizeGrad {
    fn kernel(&self) -> &'static str {
        "resize_grad"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let Resize { frames, hi, wi, ho, wo, c, .. } = self.resize;
        let dy = Rng::new(u64::from(ho * 7 + c)).normal((frames * ho * wo * c) as usize);
        vec![Values::F32(dy), Values::Out((frames * hi * wi * c) as usize)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(DX, Values::F32(cpu::resize_grad(self, args[0].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// hi, wi, ho, wo, c: one, up, down, one output, wide, a tenth.
const SHAPES: [[u32; 5]; 15] = [
    [1, 1, 3, 2, 1],
    [4, 5, 8, 10, 4],
    [5, 4, 1, 1, 3],
    [9, 13, 4, 31, 36],
    [20, 36, 40, 71, 64],
    [3, 2, 70, 33, 8],
    [6, 7, 9, 30, 6],
    [6, 7, 9, 5, 20],
    [37, 37, 20, 36, 12],
    [6, 5, 9, 12, 13],
    [5, 4, 7, 9, 128],
    [2, 300, 2, 517, 4],
    [7, 9, 11, 13, 16],
    [5, 6, 9, 70, 32],
    [3, 50, 2, 5, 16],
];

/// A specification without a code.
#[must_use]
pub const fn spec(frames: u32, [hi, wi, ho, wo, c]: [u32; 5], filter: Filter, corners: Corners) -> ResizeGrad {
    ResizeGrad { resize: Resize { frames, hi, wi, ho, wo, c, filter, corners, code: false } }
}

/// All shapes by both filters and all corners; then the up-samplings of the dense heads and of the position table.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for shape in SHAPES {
        for filter in [Filter::Bilinear, Filter::Bicubic] {
            for (frames, at) in [(2, 0), (2, 1), (1, 2)] {
                cases.push(Case::test(spec(frames, shape, filter, corners()[at])));
            }
        }
    }
    let benches = [
        ("bilinear 2x 140x252x64", spec(2, [140, 252, 280, 504, 64], Filter::Bilinear, Corners::Align)),
        ("bilinear 160x288x32", spec(2, [160, 288, 280, 504, 32], Filter::Bilinear, Corners::Align)),
        ("bilinear 160x288x6", spec(2, [160, 288, 280, 504, 6], Filter::Bilinear, Corners::HalfPixel)),
        ("bicubic 37x37x384", spec(2, [37, 37, 20, 36, 384], Filter::Bicubic, Corners::HalfPixel)),
    ];
    cases.extend(benches.map(|(name, call)| Case::bench(name, call)));
    cases
}
