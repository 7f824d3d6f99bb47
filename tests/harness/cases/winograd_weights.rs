//! Cases of `winograd_weights`: gradients that its kernels compute, on software devices alone.

use omnix_kernels::conv2d_weights::Conv2dWeights;
use omnix_kernels::winograd_weights::{DB, DW, WinogradWeights};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, cpu};

use super::conv2d_weights::spec;
use super::{Call, Case, Values, Work};

impl Call for WinogradWeights {
    fn kernel(&self) -> &'static str {
        "winograd_weights"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, caps: &Caps) -> Vec<Values> {
        let mut args = self.conv.args(caps);
        args.pop();
        args.extend([self.parts_words(), self.tiles_words()].map(|words| Values::Out(words as usize)));
        args
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        let (dw, db) = cpu::winograd_weights(self, args[0].f32(), args[1].f32());
        let weights = (DW, Values::F32(dw));
        if self.conv.bias { vec![weights, (DB, Values::F32(db))] } else { vec![weights] }
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        4e-6
    }

    /// Effective: of the sum over pixels.
    fn work(&self) -> Work {
        Work::Flops(self.conv.flops())
    }
}

/// A convolution of 3x3 with stride 1, with a bias.
#[must_use]
pub const fn square(frames: u32, size: [u32; 2], channels: [u32; 2], padding: u32) -> WinogradWeights {
    WinogradWeights { conv: spec(frames, size, channels, [3, 3], 1, padding) }
}

/// Maps of one pixel, odd sizes, several frames, several blocks and a part of one, all paddings, several bands; then the shapes of
/// `conv2d_weights`.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for call in [
        square(1, [1, 1], [8, 4], 1),
        square(1, [16, 16], [32, 32], 1),
        square(3, [17, 19], [40, 68], 1),
        square(1, [300, 1], [32, 36], 1),
        square(2, [18, 20], [64, 100], 0),
        square(1, [15, 18], [128, 40], 2),
        square(1, [5, 7], [520, 36], 1),
        square(2, [70, 67], [64, 64], 1),
    ] {
        cases.push(Case::test(call));
        cases.push(Case::test(WinogradWeights { conv: Conv2dWeights { bias: false, ..call.conv } }));
    }
    for (ci, co, hi, wi) in
        [(128, 64, 280, 504), (64, 64, 160, 288), (32, 32, 504, 280), (256, 256, 80, 144), (1024, 256, 20, 36)]
    {
        cases.push(Case::bench(format!("{ci}->{co} {hi}x{wi}"), square(1, [hi, wi], [ci, co], 1)));
    }
    cases
}
