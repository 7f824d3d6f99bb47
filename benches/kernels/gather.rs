//! `gather`: chosen tokens of a map.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::gather::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
