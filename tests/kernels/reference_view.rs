//! `reference_view` against its oracle.

use omnix_kernels::readback::read;
use omnix_kernels::reference_view::{INVERSE, ORDER, REF, ReferenceView, Strategy};
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::cases::check_all;
use omnix_tests::cases::reference_view::{cases, tokens};
use omnix_tests::{Trial, trials};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "reference_view",
        device: [choices_match_the_oracle, scores_choose_as_the_oracle_does, fixed_choices_and_few_views],
        once: [views_that_do_not_exist_are_errors],
    )
}

/// Runs and returns the reference; the order and its inverse are checked against it.
fn compute(gpu: &Gpu, spec: &ReferenceView, x: &[f32]) -> usize {
    let s = spec.s as usize;
    let args = [HostArg::F32(x), HostArg::Out(s), HostArg::Out(s), HostArg::Out(1)];
    let slices = upload(gpu, &args).expect("uploads");
    execute(gpu, &spec.record(&gpu.caps).expect("records"), &slices).expect("runs");
    let words = |arg: omnix_kernels::Arg| read::<u32>(gpu, &slices[usize::from(arg.0)]).expect("reads");
    let reference = words(REF)[0];
    let order: Vec<u32> = std::iter::once(reference).chain((0..spec.s).filter(|i| *i != reference)).collect();
    assert_eq!(words(ORDER), order, "{spec:?}");
    let inverse = words(INVERSE);
    assert!((0..s).all(|i| inverse[order[i] as usize] as usize == i), "{spec:?}: {inverse:?}");
    reference as usize
}

fn choices_match_the_oracle(gpu: &Gpu) {
    check_all(gpu, cases());
}

fn scores_choose_as_the_oracle_does(gpu: &Gpu) {
    let mut clear = 0;
    for (s, c, seed) in
        [(3, 384, 1), (4, 16, 2), (8, 384, 3), (31, 100, 4), (65, 7, 5), (130, 64, 6), (3, 1536, 7), (5, 6, 8)]
    {
        let x = tokens(s, c, seed);
        for (strategy, balanced) in [(Strategy::SaddleBalanced, true), (Strategy::SaddleSimRange, false)] {
            let got = compute(gpu, &ReferenceView { s, c, strategy }, &x);
            let shape = (s as usize, c as usize);
            let scores = cpu::reference_view_scores(balanced, shape, &x);
            let best = cpu::reference_view(strategy, shape, &x);
            // Where another view is as good but for rounding, either may win.
            assert!(scores[got] - scores[best] < 1e-4, "{strategy:?} {s} views: {got} instead of {best}: {scores:?}");
            let runner_up = (0..s as usize).filter(|i| *i != best).map(|i| scores[i]).fold(f64::INFINITY, f64::min);
            clear += usize::from(runner_up - scores[best] > 1e-4);
        }
    }
    assert!(clear >= 6, "only {clear} cases had a clear winner");
}

fn fixed_choices_and_few_views(gpu: &Gpu) {
    for s in [1, 2, 3, 8] {
        let x = tokens(s, 12, 9);
        let on = |strategy| compute(gpu, &ReferenceView { s, c: 12, strategy }, &x);
        assert_eq!(on(Strategy::First), 0);
        assert_eq!(on(Strategy::Middle), s as usize / 2);
        assert_eq!(on(Strategy::Forced(s - 1)), s as usize - 1);
        assert!(on(Strategy::SaddleBalanced) < s as usize && on(Strategy::SaddleSimRange) < s as usize);
    }
    // Equal views: the first.
    assert_eq!(compute(gpu, &ReferenceView { s: 5, c: 8, strategy: Strategy::SaddleBalanced }, &[1.0; 40]), 0);
    // Nothing finite: still a valid order.
    compute(gpu, &ReferenceView { s: 5, c: 8, strategy: Strategy::SaddleBalanced }, &[f32::NAN; 40]);
}

fn views_that_do_not_exist_are_errors() {
    let caps = Caps { max_binding: 1024, ..Caps::baseline() };
    let error = ReferenceView { s: 3, c: 4, strategy: Strategy::Forced(3) }.record(&caps).expect_err("no view 3");
    assert!(error.to_string().contains("view 3 as the reference of 3"), "{error}");
    assert!(ReferenceView { s: 0, c: 4, strategy: Strategy::First }.record(&caps).is_err());
    assert!(ReferenceView { s: 100, c: 400, strategy: Strategy::First }.record(&caps).is_err());
}
