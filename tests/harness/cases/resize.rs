//! Cases of `resize`.

use omnix_kernels::resize::{Corners, Filter, Ratio, Resize, Y};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for Resize {
    fn kernel(&self) -> &'static str {
        "resize"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut rng = Rng::new(u64::from(self.hi * 7 + self.c));
        let x = rng.normal((self.frames * self.hi * self.wi * self.c) as usize);
        let code = rng.normal(((self.ho + self.wo) * (self.c / 2)) as usize);
        let out = self.frames * self.ho * self.wo * self.c;
        vec![Values::F32(x), Values::F32(code), Values::Out(out as usize)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        vec![(Y, Values::F32(cpu::resize(self, args[0].f32(), args[1].f32())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        1e-6
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// Every way that corners lie.
#[must_use]
pub fn corners() -> [Corners; 3] {
    let ratio = |value: f64| Ratio::approximate(value).expect("in range");
    [Corners::Align, Corners::HalfPixel, Corners::HalfPixelScaled { rows: ratio(37.0 / 20.1), columns: ratio(0.4321) }]
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

/// All shapes by both filters; then the up-samplings of the dense heads and of the position table.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for [hi, wi, ho, wo, c] in SHAPES {
        for filter in [Filter::Bilinear, Filter::Bicubic] {
            for (frames, at, code) in [(2, 0, true), (1, 0, false), (2, 1, false), (1, 2, true)] {
                let (corners, code) = (corners()[at], code && c % 2 == 0);
                cases.push(Case::test(Resize { frames, hi, wi, ho, wo, c, filter, corners, code }));
            }
        }
    }
    let spec = |[hi, wi, ho, wo, c]: [u32; 5], filter, corners, code| Resize {
        frames: 2,
        hi,
        wi,
        ho,
        wo,
        c,
        filter,
        corners,
        code,
    };
    let benches = [
        ("bilinear 2x 140x252x64", spec([140, 252, 280, 504, 64], Filter::Bilinear, Corners::Align, false)),
        ("bilinear + code 160x288x32", spec([160, 288, 280, 504, 32], Filter::Bilinear, Corners::Align, true)),
        ("bilinear 160x288x6", spec([160, 288, 280, 504, 6], Filter::Bilinear, Corners::HalfPixel, false)),
        ("bilinear 160x288x3", spec([160, 288, 280, 504, 3], Filter::Bilinear, Corners::HalfPixel, false)),
        ("bicubic 37x37x384", spec([37, 37, 20, 36, 384], Filter::Bicubic, Corners::HalfPixel, false)),
    ];
    cases.extend(benches.map(|(name, call)| Case::bench(name, call)));
    cases
}
