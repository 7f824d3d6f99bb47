//! `copy`: the permutations, concatenations and rearrangements of the networks.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::copy::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
