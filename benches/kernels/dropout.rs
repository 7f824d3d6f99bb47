//! `dropout`: a hidden layer.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::dropout::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
