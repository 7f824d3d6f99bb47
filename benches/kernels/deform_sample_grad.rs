//! `deform_sample_grad`: whole images at their sampling points.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::deform_sample_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
