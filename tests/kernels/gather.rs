//! `gather` against its oracle.

use omnix_kernels::gather::{Gather, Y};
use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "gather",
        tiers: [matches_the_oracle, a_table_above_the_binding_limit_is_seen_in_windows],
        once: [impossible_rows_are_errors],
    )
}

fn check(gpu: &Gpu, spec: &Gather) -> usize {
    let mut rng = Rng::new(u64::from(spec.n + spec.c));
    let x: Vec<u32> = (0..spec.n * spec.c).map(|_| rng.bits() as u32).collect();
    // Some out of range, just above and far away.
    let index: Vec<u32> = (0..spec.m).map(|i| if i % 7 == 3 { u32::MAX } else { rng.below(spec.n + 1) }).collect();
    let slices = upload(gpu, &[HostArg::U32(&x), HostArg::U32(&index), HostArg::Out((spec.m * spec.c) as usize)])
        .expect("uploads");
    let dispatches = spec.record(&gpu.caps).expect("records");
    execute(gpu, &dispatches, &slices).expect("runs");
    let got: Vec<u32> = read(gpu, &slices[usize::from(Y.0)]).expect("reads");
    assert!(got == cpu::gather(spec.c as usize, &x, &index), "{spec:?}");
    dispatches.len()
}

fn matches_the_oracle(gpu: &Gpu) {
    for [n, m, c] in [[1, 1, 1], [5, 9, 3], [20, 7, 4], [100, 300, 36], [64, 64, 130], [33, 50, 1024]] {
        check(gpu, &Gather { n, m, c });
    }
}

fn a_table_above_the_binding_limit_is_seen_in_windows(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for [n, m, c] in [[500, 90, 36], [700, 900, 5], [9, 40, 900]] {
        assert!(check(&small, &Gather { n, m, c }) > 4);
    }
}

fn impossible_rows_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(Gather { n: 2, m: 2, c: 1000 }.record(&caps).expect_err("wide").to_string().contains("binds at most 1024"));
    assert!(Gather { n: 0, m: 2, c: 4 }.record(&caps).is_err());
}
