//! `reference_view`: the class tokens of few and of many views.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::reference_view::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
