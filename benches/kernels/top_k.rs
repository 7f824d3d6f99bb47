//! `top_k`: the scores of 16 images, and one long row.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::top_k::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
