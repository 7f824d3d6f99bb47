//! `adamw`: the weights of a layer.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::adamw::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
