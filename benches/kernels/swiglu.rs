//! `swiglu` over the tokens of the largest network.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::swiglu::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
