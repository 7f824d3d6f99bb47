//! `reduce` over the last axis and over the middle one.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::reduce::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
