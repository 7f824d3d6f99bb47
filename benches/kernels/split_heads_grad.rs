//! `split_heads_grad`: q and v of the small network.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::split_heads_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
