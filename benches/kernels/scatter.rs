//! `scatter`: chosen tokens back to their map.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::scatter::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
