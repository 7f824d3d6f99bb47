//! `grad_norm`: the gradients of a block of the largest network.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::grad_norm::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
