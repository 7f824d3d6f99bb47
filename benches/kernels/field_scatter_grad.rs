//! `field_scatter_grad`: a level's field of 16 images.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::field_scatter_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
