//! `deform_sample_grad_field`: whole images into their fields.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::deform_sample_grad_field::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
