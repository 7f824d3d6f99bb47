//! `blend` against its oracle.

use omnix_kernels::Gpu;
use omnix_kernels::blend::{Blend, Y};
use omnix_tests::cases::blend::{Shared, cases};
use omnix_tests::cases::{Call as _, check_all, results};
use omnix_tests::{Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "blend",
        tiers: [matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        once: [],
    )
}

fn matches_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 2048);
    for n in [5000, 5001] {
        let call = Shared { spec: Blend { n }, shares: [0.3, 0.7] };
        assert!(call.record(&small.caps).expect("records").len() > 5);
        let on = |gpu: &Gpu| results(gpu, &call, &call.args(&gpu.caps), &[Y]);
        assert!(on(&small) == on(gpu));
    }
}
