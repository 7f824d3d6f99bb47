//! `attention`: one image, 4 images, 16 images at 504x280 in global attention, and local attention of 4 images.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::attention::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
