//! `field_scatter_grad` against its oracle.

use omnix_kernels::field_scatter_grad::DZ;
use omnix_kernels::{Caps, Gpu};
use omnix_tests::cases::field_scatter_grad::{cases, spec};
use omnix_tests::cases::{Values, check_all, computed, computed_from};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "field_scatter_grad",
        device: [matches_the_oracle, cells_out_of_range_have_no_gradient, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn cells_out_of_range_have_no_gradient(gpu: &Gpu) {
    let spec = spec(1, 1, 3, 3, 2);
    let dfield = (1..7).map(|v| v as f32).collect();
    let args = [Values::F32(dfield), Values::U32(vec![1, 3, u32::MAX]), Values::Out(6)];
    assert_eq!(computed_from(gpu, &spec, &args, DZ), [3.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for (spec, least) in [(spec(5, 2, 7, 30, 9), 2), (spec(3, 11, 20, 100, 9), 15), (spec(9, 9, 30, 30, 9), 12)] {
        assert!(spec.record(&small.caps).expect("records").len() >= least, "{spec:?}");
        assert!(computed(&small, &spec, DZ) == computed(gpu, &spec, DZ), "{spec:?}");
    }
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for bad in
        [spec(0, 1, 1, 4, 9), spec(1, 0, 1, 4, 9), spec(1, 1, 0, 4, 9), spec(1, 1, 5, 4, 9), spec(1, 1, 1, 99, 9)]
    {
        assert!(bad.record(&caps).is_err(), "{bad:?}");
    }
}
