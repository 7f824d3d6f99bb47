//! `linear`: the products of the small and large networks, f32, f16 and int8 weights.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::linear::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
