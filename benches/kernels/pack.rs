//! `pack`: a feed-forward layer of the small network.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::pack::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
