//! `winograd_weights` at the shapes of `conv2d_weights`; rates are effective, by the operations of the sum over pixels.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::winograd_weights::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
