//! `token_expand` against its oracle.

use omnix_kernels::run::{HostArg, run};
use omnix_kernels::token_expand::{TokenExpand, Z};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, assert_close, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "token_expand",
        tiers: [matches_the_oracle_with_and_without_each_part, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors],
    )
}

fn spec([times, m, d]: [u32; 3], optional: u32) -> TokenExpand {
    TokenExpand { m, d, times, scale: optional & 1 != 0, alpha: optional & 2 != 0, kappa: optional & 4 != 0 }
}

fn compute(gpu: &Gpu, spec: &TokenExpand) -> Vec<f32> {
    let mut rng = Rng::new(u64::from(spec.m * 7 + spec.d));
    let (m, d, times) = (spec.m as usize, spec.d as usize, spec.times as usize);
    let [q, scale, shift, alpha, kappa] = [m * d, times * d, times * d, m, m].map(|n| rng.normal(n));
    let given = |data, there| if there { HostArg::F32(data) } else { HostArg::Out(1) };
    let args = [
        HostArg::F32(&q),
        given(&scale, spec.scale),
        HostArg::F32(&shift),
        given(&alpha, spec.alpha),
        given(&kappa, spec.kappa),
        HostArg::Out(times * m * d),
    ];
    let got = run(gpu, &spec.record(&gpu.caps).expect("records"), &args, usize::from(Z.0)).expect("runs");
    let want = cpu::token_expand(spec, [&q, &scale, &shift, &alpha, &kappa]);
    assert_close(&format!("{spec:?}"), &got, &want, 2e-7);
    got
}

fn matches_the_oracle_with_and_without_each_part(gpu: &Gpu) {
    for optional in 0..8 {
        for sizes in [[1, 1, 1], [3, 5, 7], [2, 9, 32], [4, 70, 12], [1, 3, 260], [16, 33, 64]] {
            compute(gpu, &spec(sizes, optional));
        }
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    // Several times at once; some tokens of one time.
    for (sizes, least) in [([9, 5, 36], 2), ([3, 90, 33], 12), ([5, 11, 64], 5)] {
        for optional in [0, 4, 7] {
            let spec = spec(sizes, optional);
            assert!(spec.record(&small.caps).expect("records").len() >= least);
            assert!(compute(&small, &spec) == compute(gpu, &spec), "{spec:?}");
        }
    }
}

fn impossible_sizes_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for sizes in [[0, 2, 3], [2, 0, 3], [2, 3, 0], [1, 1, 1000]] {
        assert!(spec(sizes, 7).record(&caps).is_err(), "{sizes:?}");
    }
}
