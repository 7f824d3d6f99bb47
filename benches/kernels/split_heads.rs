//! `split_heads`: q (norm, RoPE), k (the same, key blocks) and v of 4 images at 504x280 in the small network.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::split_heads::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
