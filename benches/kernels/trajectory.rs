//! `trajectory`: the pixels of one image, straight from the field.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::trajectory::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
