//! `swiglu` against its oracle.

use omnix_kernels::run::{HostArg, run};
use omnix_kernels::swiglu::{SwiGlu, Y};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "swiglu",
        tiers: [matches_the_oracle_and_splitting_changes_no_bit],
        once: [a_row_above_the_binding_limit_is_an_error],
    )
}

fn matches_the_oracle_and_splitting_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (m, h) in [(1, 1), (3, 5), (7, 4), (50, 36), (129, 65), (40, 128), (300, 44), (3, 28)] {
        let x = Rng::new(u64::from(m * h)).normal((m * 2 * h) as usize);
        let spec = SwiGlu { m, h };
        let want = cpu::swiglu((m as usize, h as usize), &x);
        let on = |gpu: &omnix_kernels::Gpu| {
            let args = [HostArg::F32(&x), HostArg::Out((m * h) as usize)];
            run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Y.0)).expect("runs")
        };
        assert_close(&format!("{} {m}x{h}", gpu.caps.tier), &on(gpu), &want, 1e-6);
        assert_eq!(on(gpu), on(&small), "{m}x{h}");
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(SwiGlu { m: 2, h: 1000 }.record(&caps).expect_err("too large").to_string().contains("binds at most 1024"));
}
