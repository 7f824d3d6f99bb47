//! `winograd` at the shapes of `conv2d`; rates are effective, by the operations of the sum over taps.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::winograd::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
