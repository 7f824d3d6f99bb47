//! `top_k` against its oracle.

use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::top_k::{INDEX, MASK, TopK};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "top_k",
        device: [matches_the_oracle_with_and_without_ties, long_rows_are_right, special_values_have_their_order, splitting_at_the_binding_limit_changes_nothing],
        once: [impossible_choices_are_errors],
    )
}

fn check(gpu: &Gpu, spec: TopK, x: &[f32]) -> usize {
    let sizes = [(spec.rows * spec.k) as usize, (spec.rows * spec.n) as usize];
    let slices = upload(gpu, &[HostArg::F32(x), HostArg::Out(sizes[0]), HostArg::Out(sizes[1])]).expect("uploads");
    let dispatches = spec.record(&gpu.caps).expect("records");
    execute(gpu, &dispatches, &slices).expect("runs");
    let index: Vec<u32> = read(gpu, &slices[usize::from(INDEX.0)]).expect("reads");
    let mask: Vec<f32> = read(gpu, &slices[usize::from(MASK.0)]).expect("reads");
    let (want_index, want_mask) = cpu::top_k((spec.n as usize, spec.k as usize), spec.flat, x);
    assert!(index == want_index, "{spec:?}: indices");
    assert!(mask == want_mask, "{spec:?}: mask");
    dispatches.len()
}

fn matches_the_oracle_with_and_without_ties(gpu: &Gpu) {
    for [rows, n, k] in
        [[1, 1, 1], [3, 7, 1], [2, 7, 7], [4, 64, 10], [5, 65, 64], [2, 720, 72], [1, 1000, 999], [300, 9, 4]]
    {
        let mut rng = Rng::new(u64::from(n));
        let x = rng.normal((rows * n) as usize);
        check(gpu, TopK { rows, n, k, flat: false }, &x);
        check(gpu, TopK { rows, n, k, flat: true }, &x);
        let ties: Vec<f32> = x.iter().map(|v| (v * 2.0).round()).collect();
        check(gpu, TopK { rows, n, k, flat: false }, &ties);
        check(gpu, TopK { rows, n, k, flat: false }, &vec![0.25; x.len()]);
    }
}

fn long_rows_are_right(gpu: &Gpu) {
    let (n, k) = (100_000, 10_000);
    let x: Vec<f32> = Rng::new(1).normal(n).iter().map(|v| (v * 1000.0).round()).collect();
    check(gpu, TopK { rows: 1, n: n as u32, k, flat: false }, &x);
}

fn special_values_have_their_order(gpu: &Gpu) {
    let x = [
        f32::NAN,
        f32::NEG_INFINITY,
        -0.0,
        0.0,
        f32::INFINITY,
        -f32::NAN,
        f32::MIN_POSITIVE / 4.0,
        -1.0,
        f32::MAX,
        f32::MIN,
    ];
    for k in 1..=10 {
        check(gpu, TopK { rows: 1, n: 10, k, flat: false }, &x);
    }
}

fn splitting_at_the_binding_limit_changes_nothing(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    let x = Rng::new(3).normal(37 * 301);
    assert!(check(&small, TopK { rows: 37, n: 301, k: 30, flat: true }, &x) > 5);
}

fn impossible_choices_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    for [rows, n, k] in [[0, 4, 1], [1, 4, 5], [1, 4, 0]] {
        assert!(TopK { rows, n, k, flat: false }.record(&caps).is_err());
    }
    assert!(
        TopK { rows: 1, n: 1000, k: 1, flat: false }
            .record(&caps)
            .expect_err("long")
            .to_string()
            .contains("binds at most 1024")
    );
}
