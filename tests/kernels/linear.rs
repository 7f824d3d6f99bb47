//! `linear` against its oracle.

use omnix_kernels::linear::{Linear, Y};
use omnix_kernels::{Activation, Caps, Cooperative, Dispatch, Gpu, PackedWeights, Tier, WeightType};
use omnix_shaders::linear as shaders;
use omnix_tests::cases::linear::{STORAGES, cases, spec};
use omnix_tests::cases::{Call as _, Case, Changed, check_all, computed, computed_from};
use omnix_tests::{Trial, family, relative_error, trials, with_max_binding};

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

fn every_variant_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn f16_operands_cost_their_rounding_and_stay_with_weights_that_are_no_better(gpu: &Gpu) {
    for (storage, least, most) in
        [(WeightType::F32, 0.0, 2e-6), (WeightType::F16, 1e-5, 5e-4), (WeightType::I8, 1e-5, 5e-4)]
    {
        let call = spec((70, 68, 520), storage, Activation::None, false);
        // Inputs that f16 does not hold.
        let plain = gpu.caps.clone().with_f16(false);
        let args = call.args(&plain);
        let (_, want) = call.oracle(&plain, &args).remove(0);
        let error = relative_error(&computed_from(gpu, &call, &args, Y), want.f32());
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
        let change = move |dispatch: &mut Dispatch| {
            assert_eq!(dispatch.shader.variant, chosen);
            dispatch.shader = stand_in;
        };
        // One; odd; around a tile; several steps of k with a rest.
        let shapes = [(1, 4, 4), (33, 100, 36), (64, 64, 32), (130, 96, 520)];
        let call = |shape| Changed { call: spec(shape, storage, Activation::Gelu, true), change, limit: 2e-6 };
        check_all(&gpu, shapes.map(|shape| Case::test(call(shape))));
    }
}

fn the_variant_follows_from_facts() {
    let caps = Caps::baseline().with_tier(Tier::Gpu);
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
        (Caps::lavapipe(), ["software", "software_w16", "software_w8"]),
        (Caps::lavapipe().with_vector_registers(16), ["windows", "windows_w16", "windows_w8"]),
    ];
    let chosen = |caps: &Caps, n: u32| {
        [WeightType::F32, WeightType::F16, WeightType::I8].map(|storage| {
            let weights = PackedWeights { k: 8, n, storage };
            let spec = Linear { m: 3, weights, act: Activation::None, bias: false, gamma: false, residual: false };
            spec.record(caps).expect("records")[0].shader.variant
        })
    };
    for (caps, wanted) in facts {
        assert_eq!(chosen(&caps, 12), wanted, "{caps:?}");
    }
    let lavapipe = Caps::lavapipe();
    for caps in [lavapipe.clone(), lavapipe.with_vector_registers(16)] {
        assert_eq!(chosen(&caps, 7), ["narrow", "narrow_w16", "narrow_w8"]);
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    for storage in [WeightType::F32, WeightType::I8] {
        let call = spec((200, 100, 36), storage, Activation::Gelu, true);
        // 64 rows of 100 floats are 25,600 bytes; a column block of 36 k is 4,608.
        let small = with_max_binding(gpu, 32_768);
        assert_eq!(computed(gpu, &call, Y), computed(&small, &call, Y), "{} {storage:?}", family(gpu));
    }
}

fn uniform_windows_change_no_bit(gpu: &Gpu) {
    let forms = [32, 16].map(|registers| gpu.with_caps(gpu.caps.clone().with_vector_registers(registers)));
    // Several windows a column block, and several column blocks a window.
    for shape in [(70, 68, 2052), (40, 292, 36)] {
        for storage in STORAGES {
            let [whole, windows] =
                forms.each_ref().map(|gpu| computed(gpu, &spec(shape, storage, Activation::Gelu, true), Y));
            assert_eq!(whole, windows, "{shape:?} {storage:?}");
        }
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let spec = spec((100, 4, 4096), WeightType::F32, Activation::None, false);
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let error = spec.record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
}
