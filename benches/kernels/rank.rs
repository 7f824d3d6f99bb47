//! `rank`: the threshold of a loss over an image and over a sample.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::rank::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
