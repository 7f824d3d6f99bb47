//! `splat`: a million points at 1280x720.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::splat::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
