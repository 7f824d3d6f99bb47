//! `dropout` against its oracle.

use omnix_kernels::dropout::{Dropout, Y};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::dropout::{At, cases};
use omnix_tests::cases::{Call as _, Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "dropout",
        tiers: [matches_the_oracle, leaves_out_as_many_as_it_says_and_keeps_the_mean, draws_are_unlike, what_is_left_out_is_0_even_if_not_a_number, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_probabilities_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

/// Which of n ones are kept.
fn kept(gpu: &Gpu, spec: Dropout, step: u32) -> Vec<f32> {
    let n = spec.n as usize;
    let args = [Values::F32(vec![1.0; n]), Values::U32(vec![step]), Values::Out(n)];
    computed_from(gpu, &At { spec, step }, &args, Y)
}

const MANY: Dropout = Dropout { n: 100_000, p: 0.1, seed: 5, stream: 2 };

fn leaves_out_as_many_as_it_says_and_keeps_the_mean(gpu: &Gpu) {
    for p in [0.1, 0.5, 0.9] {
        let got = kept(gpu, Dropout { p, ..MANY }, 9);
        let out = got.iter().filter(|v| **v == 0.0).count() as f64 / 1e5;
        // Five standard deviations.
        assert!((out - f64::from(p)).abs() < 5.0 * (0.25f64 / 1e5).sqrt(), "{p}: {out}");
        let mean = got.iter().map(|v| f64::from(*v)).sum::<f64>() / 1e5;
        assert!((mean - 1.0).abs() < 0.06, "{p}: mean {mean}");
    }
}

fn draws_are_unlike(gpu: &Gpu) {
    let first = kept(gpu, MANY, 9);
    assert!(first == kept(gpu, MANY, 9));
    for (other, step) in [
        (MANY, 10),
        (Dropout { stream: 3, ..MANY }, 9),
        (Dropout { seed: 6, ..MANY }, 9),
        (Dropout { seed: 5 + (1 << 32), ..MANY }, 9),
    ] {
        let other = kept(gpu, other, step);
        let both = first.iter().zip(&other).filter(|(a, b)| **a == 0.0 && **b == 0.0).count();
        // A hundredth, within five standard deviations.
        assert!((both as f64 - 1000.0).abs() < 160.0, "{both} of 100,000 are left out by both");
    }
    // Neighbours do not know of each other.
    let pairs = first.windows(2).filter(|pair| pair[0] == 0.0 && pair[1] == 0.0).count();
    assert!((pairs as f64 - 1000.0).abs() < 160.0, "{pairs} neighbours are left out together");
}

fn what_is_left_out_is_0_even_if_not_a_number(gpu: &Gpu) {
    let call = At { spec: Dropout { n: 1000, p: 0.5, ..MANY }, step: 1 };
    let args = [Values::F32(vec![f32::NAN; 1000]), Values::U32(vec![1]), Values::Out(1000)];
    let got = computed_from(gpu, &call, &args, Y);
    assert!(got.contains(&0.0) && got.iter().all(|v| v.is_nan() || *v == 0.0));
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 2048);
    for n in [5000, 5001] {
        let call = At { spec: Dropout { n, ..MANY }, step: 3 };
        assert!(call.record(&small.caps).expect("records").len() > 5);
        assert!(computed(gpu, &call, Y) == computed(&small, &call, Y));
    }
}

fn impossible_probabilities_are_errors() {
    for p in [-0.1, 1.0, f32::NAN] {
        let error = Dropout { p, ..MANY }.record(&Caps::baseline()).expect_err("no probability").to_string();
        assert!(error.contains("from 0 to below 1"), "{error}");
    }
    assert!(Dropout { n: 0, ..MANY }.record(&Caps::baseline()).expect("records").is_empty());
}
