//! `attention_grad_q`: global and local attention of the small and large networks.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::attention_grad_q::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
