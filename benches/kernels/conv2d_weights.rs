//! `conv2d_weights`: gradients of the weights of the dense heads' 3x3 convolutions.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::conv2d_weights::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
