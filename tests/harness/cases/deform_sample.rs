//! Cases of `deform_sample`.

use omnix_kernels::cpu::{self, Sampled};
use omnix_kernels::deform_sample::{DeformSample, TAU};
use omnix_kernels::{Arg, Caps, Dispatch, KernelError};

use super::{Call, Case, Values, Work};
use crate::Rng;

/// Seeded host arrays of a specification.
#[derive(Clone, Debug)]
pub struct Inputs {
    /// Where each pixel samples, in cells from its own.
    pub offsets: Vec<f32>,
    /// By what weight; they sum to 1.
    pub weights: Vec<f32>,
    /// The list of pixels.
    pub pixels: Vec<u32>,
    /// What is sampled.
    pub field: Vec<f32>,
    /// Which cells move.
    pub mask: Vec<f32>,
}

impl Inputs {
    /// Offsets of some cells, weights that sum to 1, a shuffled list, a field near the identity, half of the mask set.
    #[must_use]
    pub fn new(spec: &DeformSample) -> Self {
        let mut rng = Rng::new(u64::from(spec.n * 3 + spec.times));
        let (n, taps, cells) = (spec.n as usize, spec.taps() as usize, spec.cells() as usize);
        let offsets = rng.normal(n * taps * 2).iter().map(|v| v * 1.5).collect();
        let mut weights: Vec<f32> = rng.normal(n * taps).iter().map(|v| v.exp()).collect();
        for row in weights.chunks_exact_mut(taps) {
            let sum: f32 = row.iter().sum();
            row.iter_mut().for_each(|w| *w /= sum);
        }
        let pixels = (0..n).map(|_| rng.below(spec.width * spec.height)).collect();
        let identity = [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
        let noise = rng.normal(spec.field_words() as usize);
        let field = noise.iter().enumerate().map(|(i, v)| identity[i % 9] + 0.3 * v).collect();
        let mask = (0..cells).map(|_| rng.below(2) as f32).collect();
        Self { offsets, weights, pixels, field, mask }
    }

    /// As the oracles take them.
    #[must_use]
    pub fn sampled(&self) -> Sampled<'_> {
        let Self { offsets, weights, pixels, field, mask } = self;
        Sampled { offsets, weights, pixels, field, mask }
    }

    /// The first five arguments.
    #[must_use]
    pub fn args(&self, spec: &DeformSample) -> Vec<Values> {
        let numbers = |values: &[f32]| Values::F32(values.to_vec());
        vec![
            numbers(&self.offsets),
            numbers(&self.weights),
            if spec.listed { Values::U32(self.pixels.clone()) } else { Values::Out(1) },
            numbers(&self.field),
            numbers(&self.mask),
        ]
    }
}

impl Call for DeformSample {
    fn kernel(&self) -> &'static str {
        "deform_sample"
    }

    fn record(&self, caps: &Caps) -> Result<Vec<Dispatch>, KernelError> {
        self.record(caps)
    }

    fn args(&self, _: &Caps) -> Vec<Values> {
        let mut args = Inputs::new(self).args(self);
        args.push(Values::Out((self.n * (self.times * 9 + 1)) as usize));
        args
    }

    fn oracle(&self, _: &Caps, _: &[Values]) -> Vec<(Arg, Values)> {
        vec![(TAU, Values::F32(cpu::deform_sample(self, &Inputs::new(self).sampled())))]
    }

    fn limit(&self, _: &Caps, _: Arg) -> f64 {
        2e-6
    }

    fn work(&self) -> Work {
        Work::Flops(self.flops())
    }
}

/// All pixels of a width x height image, or `listed` of them; two levels of three points.
#[must_use]
pub const fn spec([width, height]: [u32; 2], [wp, hp]: [u32; 2], times: u32, listed: Option<u32>) -> DeformSample {
    let n = match listed {
        Some(n) => n,
        None => width * height,
    };
    DeformSample { n, width, height, hp, wp, levels: 2, points: 3, times, listed: listed.is_some() }
}

/// With the four levels of nine points of the release.
#[must_use]
pub const fn release(size: [u32; 2], grid: [u32; 2], times: u32) -> DeformSample {
    DeformSample { levels: 4, points: 9, ..spec(size, grid, times, None) }
}

/// The images of benches: width, height, columns and rows of the grid, times.
pub const NETWORKS: [DeformSample; 2] = [release([504, 280], [36, 20], 4), release([140, 84], [10, 6], 16)];

/// One pixel and one cell; one row, one column; a list, longer than a workgroup; the release's points; then whole images.
#[must_use]
pub fn cases() -> Vec<Case> {
    let tests = [
        spec([1, 1], [1, 1], 1, None),
        spec([33, 1], [7, 1], 2, None),
        spec([1, 17], [1, 4], 1, None),
        spec([33, 14], [4, 2], 5, None),
        spec([28, 14], [2, 1], 1, Some(1)),
        spec([33, 28], [6, 5], 3, Some(131)),
        release([20, 9], [5, 3], 3),
    ];
    tests.map(Case::test).into_iter().chain(NETWORKS.map(|spec| Case::bench(name(&spec), spec))).collect()
}

/// How benches call it.
pub(super) fn name(spec: &DeformSample) -> String {
    format!("{}x{}, {} cells, {} times", spec.width, spec.height, spec.cells(), spec.times)
}
