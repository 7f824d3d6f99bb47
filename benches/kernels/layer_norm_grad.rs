//! `layer_norm_grad`: the tokens of the small and large networks.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::layer_norm_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
