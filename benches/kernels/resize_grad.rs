//! `resize_grad`: the up-samplings of the dense heads and of the position table.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::resize_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
