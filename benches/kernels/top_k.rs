//! `top_k`: the scores of 16 images, and one long row.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::top_k::TopK;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for (rows, n, k) in [(16, 720, 180), (1, 100_000, 10_000)] {
        let spec = TopK { rows, n, k, flat: false };
        let case = format!("{} of {}x{}", spec.k, spec.rows, spec.n);
        if bench.wants("top_k", &case) {
            let x = numbers((spec.rows * spec.n) as usize);
            let args = [HostArg::F32(&x), HostArg::Out((spec.rows * spec.k) as usize), HostArg::Out(x.len())];
            bench.case("top_k", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
