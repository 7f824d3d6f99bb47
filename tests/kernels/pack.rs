//! `pack` against its oracle.

use omnix_kernels::pack::{Pack, Y};
use omnix_kernels::{Caps, Gpu, PackedWeights, WeightType};
use omnix_tests::cases::pack::{cases, flipped, linear, transformed};
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "pack",
        tiers: [matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        once: [bad_specifications_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 40_960);
    for spec in [linear(130, 70, false, WeightType::F32), flipped(20, 50, WeightType::F32), transformed(70, 8, false)] {
        assert!(spec.record(&small.caps).expect("records").len() > 1, "{spec:?}");
        let args = spec.args(&small.caps);
        assert!(results(&small, &spec, &args, &[Y]) == results(gpu, &spec, &args, &[Y]), "{spec:?}");
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 65_536, ..Caps::baseline() };
    let error = linear(256, 256, false, WeightType::F32).record(&caps).expect_err("too large");
    assert!(error.to_string().contains("binds at most 65536"), "{error}");
    let good = linear(8, 8, false, WeightType::F32);
    let int8 = PackedWeights { storage: WeightType::I8, ..good.weights };
    let empty = PackedWeights { n: 0, ..good.weights };
    let kernels = transformed(8, 8, false);
    let half = PackedWeights { storage: WeightType::F16, ..kernels.weights };
    let plain = PackedWeights { k: 72, ..kernels.weights };
    for bad in [
        Pack { weights: int8, ..good },
        Pack { weights: empty, ..good },
        Pack { elements: 63, ..good },
        Pack { weights: half, ..kernels },
        Pack { weights: plain, ..kernels },
        Pack { elements: 575, ..kernels },
    ] {
        assert!(bad.record(&caps).is_err(), "{bad:?}");
    }
}
