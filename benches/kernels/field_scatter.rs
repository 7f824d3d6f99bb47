//! `field_scatter`: a level's field of 16 images.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::field_scatter::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
