//! Cases of `pack`.

use omnix_kernels::pack::{Order, Pack, Y};
use omnix_kernels::winograd::PLACES;
use omnix_kernels::{Arg, Caps, Dispatch, KernelError, PackedWeights, WeightType, cpu};

use super::{Call, Case, Values, Work};
use crate::Rng;

impl Call for Pack {
    fn kernel(&self) -> &'static str {
        "pack"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let x = Rng::new(u64::from(self.elements)).normal(self.elements as usize);
        vec![Values::F32(x), Values::Out(self.weights.bytes() as usize / 4)]
    }

    fn oracle(&self, _: &Caps, args: &[Values]) -> Vec<(Arg, Values)> {
        if self.winograd {
            let bytes = cpu::pack_winograd(self.weights, self.order, args[0].f32());
            return vec![(Y, Values::F32(bytemuck::pod_collect_to_vec(&bytes)))];
        }
        let bytes = cpu::pack(self.weights, self.order, args[0].f32());
        vec![(Y, Values::U32(bytemuck::pod_collect_to_vec(&bytes)))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        if self.winograd { 1e-6 } else { 0.0 }
    }

    fn work(&self) -> Work {
        Work::Bytes(self.bytes())
    }
}

/// A matrix `[n, k]` of a linear layer, or what its transpose multiplies.
#[must_use]
pub fn linear(n: u32, k: u32, transposed: bool, storage: WeightType) -> Pack {
    let plain = Order { base: 0, n_lo: 1, n_hi: k, n_step: 0, k_lo: 1, k_hi: 1, k_step: 0 };
    let (weights, order) = if transposed {
        (PackedWeights { k: n, n: k, storage }, Order { n_hi: 1, k_hi: k, ..plain })
    } else {
        (PackedWeights { k, n, storage }, plain)
    };
    Pack { weights, order, elements: n * k, winograd: false }
}

/// The flipped kernel of a convolution `[out, in, 3, 3]`: depth counts taps down.
#[must_use]
pub fn flipped(out: u32, channels: u32, storage: WeightType) -> Pack {
    let taps = 9u32;
    let order =
        Order { base: taps - 1, n_lo: 1, n_hi: taps, n_step: 0, k_lo: out, k_hi: u32::MAX, k_step: channels * taps };
    let weights = PackedWeights { k: taps * out, n: channels, storage };
    Pack { weights, order, elements: out * channels * taps, winograd: false }
}

/// The kernel of a convolution `[out, in, 3, 3]`, or the one flipped, transformed for Winograd's algorithm.
#[must_use]
pub fn transformed(out: u32, channels: u32, turned: bool) -> Pack {
    let storage = WeightType::F32;
    let Pack { weights, order, elements, .. } = if turned {
        flipped(out, channels, storage)
    } else {
        let order = Order { base: 0, n_lo: 1, n_hi: 9 * channels, n_step: 0, k_lo: channels, k_hi: 1, k_step: 9 };
        let weights = PackedWeights { k: 9 * channels, n: out, storage };
        Pack { weights, order, elements: out * channels * 9, winograd: false }
    };
    let weights = PackedWeights { k: PLACES * order.k_lo, ..weights };
    Pack { weights, order, elements, winograd: true }
}

/// One, odd, both sides of a block of columns, transposed, flipped; then layers of the networks.
#[must_use]
pub fn cases() -> Vec<Case> {
    let mut cases = Vec::new();
    for storage in [WeightType::F32, WeightType::F16] {
        for (n, k) in [(1, 1), (3, 5), (31, 8), (32, 33), (33, 31), (70, 129), (384, 96)] {
            cases.extend([false, true].map(|transposed| Case::test(linear(n, k, transposed, storage))));
        }
        cases.extend([(1, 1), (5, 3), (34, 40)].map(|(out, channels)| Case::test(flipped(out, channels, storage))));
    }
    for (out, channels) in [(8, 8), (36, 8), (40, 16), (33, 64)] {
        cases.extend([false, true].map(|turned| Case::test(transformed(out, channels, turned))));
    }
    for transposed in [false, true] {
        let name = format!("1536x384{}", if transposed { " transposed" } else { "" });
        cases.push(Case::bench(name, linear(1536, 384, transposed, WeightType::F32)));
    }
    cases
}
