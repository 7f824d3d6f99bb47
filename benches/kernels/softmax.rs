//! `softmax` over many short and some long rows.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::softmax::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
