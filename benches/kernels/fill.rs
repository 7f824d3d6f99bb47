//! `fill`: a map of zeros.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::fill::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
