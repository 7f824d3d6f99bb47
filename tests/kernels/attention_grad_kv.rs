//! `attention_grad_kv` against its oracle.

use omnix_kernels::attention_grad_kv::{DK, DV};
use omnix_kernels::{Caps, Gpu, KernelError};
use omnix_tests::cases::attention::spec;
use omnix_tests::cases::attention_grad_kv::{SpreadKv, cases};
use omnix_tests::cases::{Call as _, Values, check_all, results};
use omnix_tests::{Trial, family, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "attention_grad_kv",
        tiers: [every_shape_matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit, a_key_that_is_not_finite_stays_alone],
        once: [bad_specifications_are_errors],
    )
}

fn every_shape_matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let mut split = 0;
    for spec in [
        spec(4, 3, 48, 70, 37),
        spec(1, 2, 64, 300, 200),
        spec(3, 2, 24, 65, 64),
        spec(1, 2, 128, 33, 70),
        spec(2, 3, 6, 300, 70),
    ] {
        let call = SpreadKv { spec, spread: 1.0, exact: true };
        let args = call.args(&gpu.caps);
        let whole = results(gpu, &call, &args, &[DK, DV]);
        for limit in [32_768, 65_536] {
            let small = with_max_binding(gpu, limit);
            let pieces = |gpu: &Gpu| call.record(&gpu.caps).expect("records").len();
            split += usize::from(pieces(&small) > pieces(gpu));
            assert_eq!(whole, results(&small, &call, &args, &[DK, DV]), "{} {limit} {spec:?}", family(gpu));
        }
    }
    assert!(split >= 6, "{}: only {split} of 10 cases were split", family(gpu));
}

fn a_key_that_is_not_finite_stays_alone(gpu: &Gpu) {
    let spec = spec(1, 2, 32, 20, 40);
    let call = SpreadKv { spec, spread: 1.0, exact: true };
    let mut args = call.args(&gpu.caps);
    let clean = results(gpu, &call, &args, &[DK, DV]);
    // Key 9 of head 1, channel 5, in its block.
    let mut k = args[1].f32().to_vec();
    k[64 * 32 + 5 * 32 + 9] = f32::NAN;
    args[1] = Values::F32(k);
    let got = results(gpu, &call, &args, &[DK, DV]);
    for (got, clean) in got.iter().zip(&clean) {
        for (at, (got, clean)) in got.iter().zip(clean).enumerate() {
            if at / 32 == 64 + 9 {
                assert!(f32::from_bits(*got).is_nan(), "{} {at}", family(gpu));
            } else {
                assert_eq!(got, clean, "{} {at}", family(gpu));
            }
        }
    }
}

fn bad_specifications_are_errors() {
    let caps = Caps { max_binding: 4096, ..Caps::baseline() };
    for spec in [spec(0, 1, 32, 1, 1), spec(1, 1, 32, 1, 0), spec(1, 1, 31, 1, 1), spec(1, 1, 130, 1, 1)] {
        let error = SpreadKv { spec, spread: 1.0, exact: true }.record(&caps).expect_err("unsupported");
        assert!(matches!(error, KernelError::Unsupported { .. }), "{error}");
    }
    let error = SpreadKv { spec: spec(1, 1, 64, 9, 9), spread: 1.0, exact: true }
        .record(&caps)
        .expect_err("32 rows of 256 bytes");
    assert!(error.to_string().contains("binds at most 4096"), "{error}");
}
