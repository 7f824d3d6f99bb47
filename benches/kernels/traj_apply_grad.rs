//! `traj_apply_grad`: the pixels of one image.

use omnix_benches::Bench;
use omnix_kernels::KernelError;
use omnix_tests::cases::traj_apply_grad::cases;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    bench.cases(cases())
}
