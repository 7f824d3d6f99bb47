//! `layer_norm` against its oracle.

use omnix_kernels::layer_norm::{LayerNorm, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Activation, Caps, Gpu, KernelError, cpu};
use omnix_tests::{Rng, Trial, assert_close, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "layer_norm",
        families: [every_variant_matches_the_oracle, a_common_offset_costs_no_more_than_its_rounding, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

/// Rows and channels: one, odd, below and above a subgroup, a workgroup and a tile of rows.
const SHAPES: &[(u32, u32)] = &[
    (1, 1),
    (2, 3),
    (3, 4),
    (5, 30),
    (65, 32),
    (7, 36),
    (7, 72),
    (130, 63),
    (9, 384),
    (66, 1024),
    (3, 2048),
    (3, 4100),
    (3, 4104),
];

fn case(gpu: &Gpu, spec: &LayerNorm, offset: f32) -> (Vec<f32>, Vec<f32>) {
    let (m, c) = (spec.m as usize, spec.c as usize);
    let mut rng = Rng::new(u64::from(spec.m * 31 + spec.c));
    let x: Vec<f32> = rng.normal(m * c).iter().map(|v| v * 3.0 + offset).collect();
    let (weight, bias) = (rng.normal(c), rng.normal(c));
    let args = [HostArg::F32(&x), HostArg::F32(&weight), HostArg::F32(&bias), HostArg::Out(m * c)];
    let dispatches = spec.record(&gpu.caps).expect("records");
    let got = run(gpu, &dispatches, &args, usize::from(Y.0)).expect("runs");
    let given = |on: bool, values| if on { Some(values) } else { None };
    let want =
        cpu::layer_norm((m, c), &x, spec.eps, spec.act, given(spec.weight, &weight[..]), given(spec.bias, &bias[..]));
    (got, want)
}

fn spec(m: u32, c: u32, act: Activation, affine: bool) -> LayerNorm {
    LayerNorm { m, c, eps: 1e-6, act, weight: affine, bias: affine }
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    for &(m, c) in SHAPES {
        for (act, affine) in [(Activation::None, true), (Activation::Gelu, false), (Activation::Relu, true)] {
            let (got, want) = case(gpu, &spec(m, c, act, affine), 0.0);
            assert_close(&format!("{} [{m}, {c}] {act:?} affine {affine}", family(gpu)), &got, &want, 2e-6);
        }
    }
    for (weight, bias) in [(true, false), (false, true)] {
        let (got, want) = case(gpu, &LayerNorm { weight, bias, ..spec(4, 40, Activation::None, true) }, 0.0);
        assert_close(&format!("{} weight {weight} bias {bias}", family(gpu)), &got, &want, 2e-6);
    }
}

fn a_common_offset_costs_no_more_than_its_rounding(gpu: &Gpu) {
    // One-pass variance would lose everything here: mean² is 10⁶ times the variance.
    let (got, want) = case(gpu, &spec(5, 384, Activation::None, false), 3000.0);
    assert_close(&family(gpu), &got, &want, 2e-4);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for c in [96, 100, 33] {
        let spec = spec(200, c, Activation::Gelu, true);
        let (whole, _) = case(gpu, &spec, 0.0);
        let small = with_max_binding(gpu, 25_600);
        assert!(spec.record(&small.caps).expect("records").len() > 1);
        let (split, _) = case(&small, &spec, 0.0);
        assert_eq!(whole, split, "{}", family(gpu));
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let error = spec(100, 4096, Activation::None, true).record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
    for (m, c) in [(0, 4), (4, 0)] {
        let error = spec(m, c, Activation::None, true).record(&caps).expect_err("empty");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
}
