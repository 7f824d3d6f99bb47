//! `deform_sample` against its oracle.

use omnix_kernels::cpu::{self, Sampled};
use omnix_kernels::deform_sample::{DeformSample, TAU};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "deform_sample",
        device: [matches_the_oracle, offsets_far_outside_stop_at_the_border_where_half_the_weight_falls_on_cells, splitting_at_the_binding_limit_changes_no_bit, a_list_gives_the_bits_of_the_whole_image, what_is_not_a_number_ends],
        once: [impossible_sizes_are_errors],
    )
}

/// Seeded host arrays of a specification.
#[derive(Clone)]
pub(crate) struct Inputs {
    pub(crate) offsets: Vec<f32>,
    pub(crate) weights: Vec<f32>,
    pub(crate) pixels: Vec<u32>,
    pub(crate) field: Vec<f32>,
    pub(crate) mask: Vec<f32>,
}

impl Inputs {
    /// Offsets of some cells, weights that sum to 1, a shuffled list, a field near the identity, half of the mask set.
    pub(crate) fn new(spec: &DeformSample) -> Self {
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

    pub(crate) fn sampled(&self) -> Sampled<'_> {
        let Self { offsets, weights, pixels, field, mask } = self;
        Sampled { offsets, weights, pixels, field, mask }
    }
}

/// All pixels of a width x height image, or `listed` of them.
pub(crate) const fn spec(
    [width, height]: [u32; 2],
    [wp, hp]: [u32; 2],
    times: u32,
    listed: Option<u32>,
) -> DeformSample {
    let n = match listed {
        Some(n) => n,
        None => width * height,
    };
    DeformSample { n, width, height, hp, wp, levels: 2, points: 3, times, listed: listed.is_some() }
}

pub(crate) fn compute(gpu: &Gpu, spec: &DeformSample, inputs: &Inputs) -> Vec<f32> {
    let args = [
        HostArg::F32(&inputs.offsets),
        HostArg::F32(&inputs.weights),
        if spec.listed { HostArg::U32(&inputs.pixels) } else { HostArg::Out(1) },
        HostArg::F32(&inputs.field),
        HostArg::F32(&inputs.mask),
        HostArg::Out((spec.n * (spec.times * 9 + 1)) as usize),
    ];
    run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(TAU.0)).expect("runs")
}

fn matches_the_oracle(gpu: &Gpu) {
    let mut release = spec([20, 9], [5, 3], 3, None);
    (release.levels, release.points) = (4, 9);
    // One pixel and one cell; one row, one column; a list, longer than a workgroup; the release's points.
    for spec in [
        spec([1, 1], [1, 1], 1, None),
        spec([33, 1], [7, 1], 2, None),
        spec([1, 17], [1, 4], 1, None),
        spec([33, 14], [4, 2], 5, None),
        spec([28, 14], [2, 1], 1, Some(1)),
        spec([33, 28], [6, 5], 3, Some(131)),
        release,
    ] {
        let inputs = Inputs::new(&spec);
        assert_close(
            &format!("{spec:?}"),
            &compute(gpu, &spec, &inputs),
            &cpu::deform_sample(&spec, &inputs.sampled()),
            2e-6,
        );
    }
}

fn offsets_far_outside_stop_at_the_border_where_half_the_weight_falls_on_cells(gpu: &Gpu) {
    let spec = spec([14, 14], [3, 2], 2, None);
    let mut inputs = Inputs::new(&spec);
    inputs.offsets.iter_mut().for_each(|o| *o = 1e9 * o.signum());
    inputs.mask.fill(1.0);
    let got = compute(gpu, &spec, &inputs);
    assert_close("far offsets", &got, &cpu::deform_sample(&spec, &inputs.sampled()), 2e-6);
    // Every point lies in a corner: a quarter of the weights, which sum to 1.
    let row = spec.times as usize * 9 + 1;
    assert!(got.chunks_exact(row).all(|r| (r[row - 1] - 0.25).abs() < 1e-6));
    inputs.mask.fill(0.0);
    assert!(compute(gpu, &spec, &inputs).chunks_exact(row).all(|r| r[row - 1] == 0.0));
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for spec in [spec([33, 28], [4, 3], 3, None), spec([33, 28], [4, 3], 5, Some(500))] {
        let inputs = Inputs::new(&spec);
        assert!(spec.record(&small.caps).expect("records").len() > 6);
        assert!(compute(&small, &spec, &inputs) == compute(gpu, &spec, &inputs), "{spec:?}");
    }
}

fn a_list_gives_the_bits_of_the_whole_image(gpu: &Gpu) {
    let all = spec([33, 28], [4, 3], 3, None);
    let inputs = Inputs::new(&all);
    let whole = compute(gpu, &all, &inputs);
    let pixels = [923, 0, 33, 32, 500];
    let listed = spec([33, 28], [4, 3], 3, Some(5));
    let rows = |data: &[f32], width: usize| -> Vec<f32> {
        pixels.iter().flat_map(|p| data[*p as usize * width..][..width].to_vec()).collect()
    };
    let some = Inputs {
        offsets: rows(&inputs.offsets, 12),
        weights: rows(&inputs.weights, 6),
        pixels: pixels.to_vec(),
        ..inputs.clone()
    };
    assert!(compute(gpu, &listed, &some) == rows(&whole, 28));
}

fn what_is_not_a_number_ends(gpu: &Gpu) {
    let spec = spec([28, 14], [4, 3], 2, None);
    let mut inputs = Inputs::new(&spec);
    let bad = [f32::NAN, f32::INFINITY, f32::NEG_INFINITY];
    inputs.offsets.iter_mut().step_by(5).zip(bad.iter().cycle()).for_each(|(o, b)| *o = *b);
    inputs.weights[7] = f32::NAN;
    let got = compute(gpu, &spec, &inputs);
    assert_eq!(got.len(), 28 * 14 * 19);
    // Pixel 1 has the bad weight.
    assert!(got[19..38].iter().all(|v| v.is_nan()));
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    let good = spec([14, 14], [1, 1], 1, None);
    assert!(good.record(&caps).is_ok());
    for bad in [
        DeformSample { n: 0, ..good },
        DeformSample { n: 5, ..good },
        DeformSample { points: 0, ..good },
        DeformSample { times: 0, ..good },
        DeformSample { wp: 0, ..good },
        DeformSample { hp: 80, ..good },
        DeformSample { times: 200, ..good },
    ] {
        assert!(bad.record(&caps).is_err(), "{bad:?}");
    }
}
