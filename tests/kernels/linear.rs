//! `linear` against its oracle.

use omnix_kernels::linear::{Linear, Y};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Activation, Cooperative, Dispatch, Gpu, PackedWeights, Tier, WeightType, cpu};
use omnix_shaders::linear as shaders;
use omnix_tests::{Rng, Trial, as_f16, assert_close, family, relative_error, rounds, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "linear",
        products: [every_variant_matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        half: [f16_operands_cost_their_rounding_and_stay_with_weights_that_are_no_better],
        software: [uniform_windows_change_no_bit],
        stand_ins: [cooperative_tiles_match_the_oracle_through_their_stand_ins],
        once: [the_variant_follows_from_facts, a_row_above_the_binding_limit_is_an_error],
    )
}

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
    (37, 2, 32),
    (9, 3, 4),
    (70, 7, 100),
];

fn case(gpu: &Gpu, shape: (u32, u32, u32), storage: WeightType, act: Activation, full: bool) -> (Vec<f32>, Vec<f32>) {
    compute(gpu, shape, storage, act, full, rounds(gpu), &|_| ())
}

/// Result and oracle; `round` takes an input that f16 holds exactly, `change` sees every dispatch before it runs.
fn compute(
    gpu: &Gpu,
    (m, n, k): (u32, u32, u32),
    storage: WeightType,
    act: Activation,
    full: bool,
    round: bool,
    change: &dyn Fn(&mut Dispatch),
) -> (Vec<f32>, Vec<f32>) {
    let mut rng = Rng::new(u64::from(m * 31 + n * 7 + k));
    let (mu, nu, ku) = (m as usize, n as usize, k as usize);
    let x = rng.normal(mu * ku);
    let x = if round { as_f16(&x) } else { x };
    let weights = PackedWeights { k, n, storage };
    let w = as_f16(&rng.normal(nu * ku).iter().map(|v| v / (k as f32).sqrt()).collect::<Vec<_>>());
    let w = if storage == WeightType::I8 { as_int8(&w, ku) } else { w };
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
    let mut dispatches = spec.record(&gpu.caps).expect("records");
    dispatches.iter_mut().for_each(change);
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

/// Columns of `k` weights to the nearest of 255 steps between the column's largest and its negative.
fn as_int8(w: &[f32], k: usize) -> Vec<f32> {
    let column = |c: &[f32]| {
        let scale = c.iter().fold(0.0f32, |most, w| most.max(w.abs())) / 127.0;
        c.iter().map(|w| (w / scale).round() * scale).collect::<Vec<_>>()
    };
    w.chunks(k).flat_map(column).collect()
}

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    for &shape in SHAPES {
        for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
            for (act, full) in [
                (Activation::None, false),
                (Activation::Gelu, true),
                (Activation::Relu, true),
                (Activation::Silu, false),
            ] {
                let (got, want) = case(gpu, shape, storage, act, full);
                // Matrix units add with their own rounding (an H200: 2.5e-6 at k = 2052, with f16 operands).
                let Cooperative { f16_16, f32_8 } = gpu.caps.cooperative;
                let matrix_units = f32_8 || f16_16 && storage != WeightType::F32;
                let most = if matrix_units { 1e-5 } else { 2e-6 };
                let label = format!("{} {shape:?} {storage:?} {act:?} full {full}", family(gpu));
                assert_close(&label, &got, &want, most);
            }
        }
    }
}

fn f16_operands_cost_their_rounding_and_stay_with_weights_that_are_no_better(gpu: &Gpu) {
    for (storage, least, most) in
        [(WeightType::F32, 0.0, 2e-6), (WeightType::F16, 1e-5, 5e-4), (WeightType::I8, 1e-5, 5e-4)]
    {
        let (got, want) = compute(gpu, (70, 68, 520), storage, Activation::None, false, false, &|_| ());
        let error = relative_error(&got, &want);
        assert!((least..most).contains(&error), "{storage:?}: {error:.1e}");
    }
}

fn cooperative_tiles_match_the_oracle_through_their_stand_ins(gpu: &Gpu) {
    let products = Cooperative { f16_16: true, f32_8: true };
    let caps = gpu.caps.clone().with_subgroup(Some([32, 32])).with_cooperative(products);
    let stand_ins = if caps.f16 {
        // Eight subgroups, of which four have nothing of their own to do, and two, which take two turns.
        vec![
            (WeightType::F16, "cooperative_16_w16", &shaders::STAND_IN_16_16),
            (WeightType::F16, "cooperative_16_w16", &shaders::STAND_IN_16_64),
        ]
    } else {
        vec![(WeightType::F32, "cooperative_8", &shaders::STAND_IN_8_32)]
    };
    let gpu = gpu.with_caps(caps);
    for (storage, chosen, stand_in) in stand_ins {
        let change = |dispatch: &mut Dispatch| {
            assert_eq!(dispatch.shader.variant, chosen);
            dispatch.shader = stand_in;
        };
        // One; odd; around a tile; several steps of k with a rest.
        for shape in [(1, 4, 4), (33, 100, 36), (64, 64, 32), (130, 96, 520)] {
            let round = storage == WeightType::F16;
            let (got, want) = compute(&gpu, shape, storage, Activation::Gelu, true, round, &change);
            assert_close(&format!("{} {shape:?}", stand_in.variant), &got, &want, 2e-6);
        }
    }
}

fn the_variant_follows_from_facts() {
    let caps = omnix_kernels::Caps::baseline().with_tier(Tier::Gpu);
    let both = Cooperative { f16_16: true, f32_8: true };
    let only_8 = Cooperative { f16_16: false, f32_8: true };
    let lanes = Some([8, 32]);
    let facts = [
        (caps.clone(), ["gpu", "gpu_w16", "gpu_w8"]),
        (caps.clone().with_f16(true), ["gpu", "gpu_f16_w16", "gpu_f16_w8"]),
        (
            caps.clone().with_f16(true).with_subgroup(lanes).with_cooperative(both),
            ["cooperative_8", "cooperative_16_w16", "cooperative_16_w8"],
        ),
        (
            caps.clone().with_f16(true).with_subgroup(lanes).with_cooperative(only_8),
            ["cooperative_8", "cooperative_8_w16", "cooperative_8_w8"],
        ),
        (caps.with_cooperative(both), ["gpu", "gpu_w16", "gpu_w8"]),
        (omnix_kernels::Caps::lavapipe(), ["software", "software_w16", "software_w8"]),
        (omnix_kernels::Caps::lavapipe().with_vector_registers(16), ["windows", "windows_w16", "windows_w8"]),
    ];
    let chosen = |caps: &omnix_kernels::Caps, n: u32| {
        [WeightType::F32, WeightType::F16, WeightType::I8].map(|storage| {
            let weights = PackedWeights { k: 8, n, storage };
            let spec = Linear { m: 3, weights, act: Activation::None, bias: false, gamma: false, residual: false };
            spec.record(caps).expect("records")[0].shader.variant
        })
    };
    for (caps, wanted) in facts {
        assert_eq!(chosen(&caps, 12), wanted, "{caps:?}");
    }
    let lavapipe = omnix_kernels::Caps::lavapipe();
    for caps in [lavapipe.clone(), lavapipe.with_vector_registers(16)] {
        assert_eq!(chosen(&caps, 7), ["narrow", "narrow_w16", "narrow_w8"]);
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for storage in [WeightType::F32, WeightType::I8] {
        let shape = (200, 100, 36);
        let (whole, _) = case(gpu, shape, storage, Activation::Gelu, true);
        // 64 rows of 100 floats are 25,600 bytes; a column block of 36 k is 4,608.
        let small = with_max_binding(gpu, 32_768);
        let (split, _) = case(&small, shape, storage, Activation::Gelu, true);
        assert_eq!(whole, split, "{} {storage:?}", family(gpu));
    }
}

fn uniform_windows_change_no_bit(gpu: &Gpu) {
    let forms = [32, 16].map(|registers| gpu.with_caps(gpu.caps.clone().with_vector_registers(registers)));
    // Several windows a column block, and several column blocks a window.
    for shape in [(70, 68, 2052), (40, 292, 36)] {
        for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
            let [whole, windows] = forms.each_ref().map(|gpu| case(gpu, shape, storage, Activation::Gelu, true).0);
            assert_eq!(whole, windows, "{shape:?} {storage:?}");
        }
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let weights = PackedWeights { k: 4096, n: 4, storage: WeightType::F32 };
    let spec = Linear { m: 100, weights, act: Activation::None, bias: false, gamma: false, residual: false };
    let caps = omnix_kernels::Caps { max_binding: 65_536, ..omnix_kernels::Caps::baseline() };
    let error = spec.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
