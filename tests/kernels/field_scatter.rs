//! `field_scatter` against its oracle.

use omnix_kernels::field_scatter::{FIELD, FieldScatter};
use omnix_kernels::run::{HostArg, run};
use omnix_kernels::{Caps, Gpu, cpu};
use omnix_tests::{Rng, Trial, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "field_scatter",
        device: [matches_the_oracle, splitting_at_the_binding_limit_changes_no_bit],
        once: [impossible_sizes_are_errors],
    )
}

const fn spec(sources: u32, times: u32, k: u32, cells: u32, c: u32) -> FieldScatter {
    FieldScatter { sources, times, k, cells, c }
}

/// Runs `spec`, compares bit for bit, returns the number of dispatches.
fn check(gpu: &Gpu, spec: &FieldScatter) -> usize {
    let mut rng = Rng::new(u64::from(spec.k + spec.cells));
    let z = rng.normal((spec.times * spec.sources * spec.k * spec.c) as usize);
    let rest = rng.normal(spec.c as usize);
    let mut index = Vec::new();
    for _ in 0..spec.sources {
        let mut cells: Vec<u32> = (0..spec.cells).collect();
        for i in (1..cells.len()).rev() {
            cells.swap(i, rng.below(i as u32 + 1) as usize);
        }
        cells.truncate(spec.k as usize);
        cells.sort_unstable();
        index.extend(cells);
    }
    let out = (spec.sources * spec.times * spec.cells * spec.c) as usize;
    let args = [HostArg::F32(&z), HostArg::U32(&index), HostArg::F32(&rest), HostArg::Out(out)];
    let dispatches = spec.record(&gpu.caps).expect("records");
    let got = run(gpu, &dispatches, &args, usize::from(FIELD.0)).expect("runs");
    assert!(got == cpu::field_scatter(spec, &z, &index, &rest), "{spec:?}");
    dispatches.len()
}

fn matches_the_oracle(gpu: &Gpu) {
    // One cell; all chosen (K = L); one time; larger than a workgroup; other channel counts.
    for spec in [
        spec(1, 1, 1, 1, 9),
        spec(3, 3, 20, 20, 9),
        spec(4, 1, 3, 30, 9),
        spec(1, 5, 6, 30, 9),
        spec(5, 4, 144, 720, 9),
        spec(2, 3, 1, 65, 3),
    ] {
        check(gpu, &spec);
    }
}

fn splitting_at_the_binding_limit_changes_no_bit(gpu: &Gpu) {
    let small = with_max_binding(gpu, 8192);
    for (spec, least) in [(spec(5, 2, 7, 30, 9), 2), (spec(3, 11, 20, 100, 9), 15), (spec(9, 9, 30, 30, 9), 12)] {
        assert!(check(&small, &spec) >= least, "{spec:?}");
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
