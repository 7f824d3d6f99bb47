//! `scatter` against its oracle.

use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::scatter::{Scatter, Y};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "scatter",
        tiers: [matches_the_oracle, a_target_above_the_binding_limit_is_seen_in_windows],
        once: [a_row_above_the_binding_limit_is_an_error],
    )
}

fn check(gpu: &Gpu, spec: &Scatter) -> usize {
    let mut rng = Rng::new(u64::from(spec.n + spec.c));
    let x: Vec<u32> = (0..spec.m * spec.c).map(|_| rng.bits() as u32).collect();
    let mut y: Vec<u32> = (0..spec.n * spec.c).collect();
    // The first m of a shuffled 0..n+3: each once, some out of range.
    let mut index: Vec<u32> = (0..(spec.n + 3).max(spec.m)).collect();
    for i in (1..index.len()).rev() {
        index.swap(i, rng.below(i as u32 + 1) as usize);
    }
    index.truncate(spec.m as usize);
    let slices = upload(gpu, &[HostArg::U32(&x), HostArg::U32(&index), HostArg::U32(&y)]).expect("uploads");
    let dispatches = spec.record(&gpu.caps).expect("records");
    execute(gpu, &dispatches, &slices).expect("runs");
    let got: Vec<u32> = read(gpu, &slices[usize::from(Y.0)]).expect("reads");
    cpu::scatter(spec.c as usize, &x, &index, &mut y);
    assert!(got == y, "{spec:?}");
    dispatches.len()
}

fn matches_the_oracle(gpu: &Gpu) {
    for [n, m, c] in [[1, 1, 1], [9, 5, 3], [20, 7, 4], [300, 100, 36], [64, 64, 130], [50, 33, 1024], [3, 20, 8]] {
        check(gpu, &Scatter { n, m, c });
    }
}

fn a_target_above_the_binding_limit_is_seen_in_windows(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for [n, m, c] in [[500, 90, 36], [900, 700, 5], [40, 9, 900]] {
        assert!(check(&small, &Scatter { n, m, c }) > 4);
    }
}

fn a_row_above_the_binding_limit_is_an_error() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    assert!(Scatter { n: 2, m: 2, c: 1000 }.record(&caps).is_err());
    assert!(Scatter { n: 0, m: 2, c: 4 }.record(&caps).expect("records").is_empty());
}
