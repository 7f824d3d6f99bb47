//! `conv2d`: the 3x3 convolutions of the dense heads, f32 and f16 weights.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::conv2d::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
