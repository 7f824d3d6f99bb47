//! `swiglu_grad`: the gate of the largest network's feed-forward layers.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::swiglu_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
