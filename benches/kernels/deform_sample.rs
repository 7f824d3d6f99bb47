//! `deform_sample`: the pixels of one image, the release's sampling points.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::deform_sample::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
