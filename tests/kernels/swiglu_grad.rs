//! `swiglu_grad` against its oracle.

use omnix_kernels::swiglu_grad::{DX, SwiGluGrad};
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::swiglu_grad::cases;
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "swiglu_grad",
        tiers: [matches_the_oracle, large_gates_have_finite_gradients, splitting_at_the_binding_limit_changes_no_bit],
        once: [a_row_above_the_binding_limit_is_an_error],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn large_gates_have_finite_gradients(gpu: &Gpu) {
    let x = [-1e30, -200.0, -90.0, 1e30, 2.0, 2.0, 2.0, 2.0];
    let args = [Values::F32(x.to_vec()), Values::F32(vec![1.0; 4]), Values::Out(8)];
    let dx = computed_from(gpu, &SwiGluGrad { m: 1, h: 4 }, &args, DX);
    assert!(dx[..3].iter().chain(&dx[4..7]).all(|v| v.abs() < 1e-30) && dx[3] == 2.0 && dx[7] == 1e30, "{dx:?}");
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (m, h) in [(50, 36), (129, 65), (40, 128), (300, 44)] {
        let spec = SwiGluGrad { m, h };
        assert!(spec.record(&small.caps).expect("records").len() > 1, "{spec:?}");
        assert_eq!(computed(gpu, &spec, DX), computed(&small, &spec, DX), "{spec:?}");
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    let error = SwiGluGrad { m: 2, h: 1000 }.record(&caps).expect_err("too large").to_string();
    assert!(error.contains("binds at most 1024"), "{error}");
    assert!(SwiGluGrad { m: 0, h: 4 }.record(&caps).expect("records").is_empty());
}
