//! `pointwise`: cheap and costly operations over maps.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::pointwise::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
