//! `linear_weights`: gradients of the weights of the small and large networks' layers.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::linear_weights::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
