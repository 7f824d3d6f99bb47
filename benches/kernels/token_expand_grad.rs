//! `token_expand_grad`: chosen tokens times target times.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::token_expand_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
