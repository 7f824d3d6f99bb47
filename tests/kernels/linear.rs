//! `linear` against its oracle.

use half::f16;
use omnix_kernels::linear::{Linear, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Activation, Gpu, PackedWeights, WeightType, cpu};
use omnix_tests::{Rng, assert_close, tiers, with_max_binding};

/// Rows, columns, depth: one, odd, tile edges, several column blocks, several uniform windows.
const SHAPES: &[(u32, u32, u32)] = &[
    (1, 1, 1),
    (1, 4, 4),
    (3, 7, 9),
    (5, 36, 588),
    (16, 32, 64),
    (17, 33, 13),
    (33, 100, 36),
    (130, 96, 520),
    (64, 8, 1028),
    (70, 68, 2052),
];

fn case(
    gpu: &Gpu,
    (m, n, k): (u32, u32, u32),
    storage: WeightType,
    act: Activation,
    full: bool,
) -> (Vec<f32>, Vec<f32>) {
    let mut rng = Rng::new(u64::from(m * 31 + n * 7 + k));
    let (mu, nu, ku) = (m as usize, n as usize, k as usize);
    let x = rng.normal(mu * ku);
    let weights = PackedWeights { k, n, storage };
    let w: Vec<f32> = rng.normal(nu * ku).iter().map(|v| f16::from_f32(v / (k as f32).sqrt()).to_f32()).collect();
    let weight = |row: usize, column: usize| w[column * ku + row];
    let (bias, gamma, residual) = (rng.normal(nu), rng.normal(nu), rng.normal(mu * nu));
    let spec = Linear { m, weights, act, bias: full, gamma: full, residual: full };
    let packed = weights.pack(weight);
    let args = [
        HostArg::F32(&x),
        HostArg::Bytes(&packed),
        HostArg::F32(&bias),
        HostArg::F32(&gamma),
        HostArg::F32(&residual),
        HostArg::Out(mu * nu),
    ];
    let dispatches = spec.record(&gpu.caps).expect("records");
    let got = run(gpu, &dispatches, &args, usize::from(Y.0)).expect("runs");

    let want = cpu::linear(
        (mu, nu, ku),
        &x,
        &weight,
        act,
        full.then_some(bias.as_slice()),
        full.then_some(gamma.as_slice()),
        full.then_some(residual.as_slice()),
    );
    (got, want)
}

#[test]
fn every_variant_matches_the_oracle() {
    for gpu in tiers() {
        for &shape in SHAPES {
            for storage in [WeightType::F32, WeightType::F16] {
                for (act, full) in [
                    (Activation::None, false),
                    (Activation::Gelu, true),
                    (Activation::Relu, true),
                    (Activation::Silu, false),
                ] {
                    let (got, want) = case(&gpu, shape, storage, act, full);
                    assert_close(
                        &format!("{} {shape:?} {storage:?} {act:?} full {full}", gpu.caps.tier),
                        &got,
                        &want,
                        2e-6,
                    );
                }
            }
        }
    }
}

#[test]
fn splitting_at_the_binding_limit_changes_no_bit() {
    for gpu in tiers() {
        let shape = (200, 100, 36);
        let (whole, _) = case(&gpu, shape, WeightType::F32, Activation::Gelu, true);
        // 64 rows of 100 floats are 25,600 bytes; a column block of 36 k is 4,608.
        let small = with_max_binding(&gpu, 32_768);
        let (split, _) = case(&small, shape, WeightType::F32, Activation::Gelu, true);
        assert_eq!(whole, split, "{}", gpu.caps.tier);
    }
}

#[test]
fn a_row_above_the_binding_limit_is_an_error() {
    let weights = PackedWeights { k: 4096, n: 4, storage: WeightType::F32 };
    let spec = Linear { m: 100, weights, act: Activation::None, bias: false, gamma: false, residual: false };
    let caps = omnix_kernels::Caps { max_binding: 65_536, ..omnix_kernels::Caps::baseline() };
    let error = spec.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
