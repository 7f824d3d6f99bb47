//! `scatter`: chosen tokens back to their map.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::scatter::Scatter;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let spec = Scatter { n: 11_520, m: 2880, c: 512 };
    if bench.wants("scatter", "2880 of 11520x512") {
        let x = numbers((spec.m * spec.c) as usize);
        let index: Vec<u32> = (0..spec.m).map(|i| i * 4 + i % 3).collect();
        let args = [HostArg::F32(&x), HostArg::U32(&index), HostArg::Out((spec.n * spec.c) as usize)];
        bench.case("scatter", "2880 of 11520x512", Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
