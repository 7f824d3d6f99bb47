//! `gather`: chosen tokens of a map.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::gather::Gather;
use omnix_kernels::run::HostArg;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let spec = Gather { n: 11_520, m: 2880, c: 512 };
    if bench.wants("gather", "2880 of 11520x512") {
        let x = numbers((spec.n * spec.c) as usize);
        let index: Vec<u32> = (0..spec.m).map(|i| i * 4 + i % 3).collect();
        let args = [HostArg::F32(&x), HostArg::U32(&index), HostArg::Out((spec.m * spec.c) as usize)];
        bench.case("gather", "2880 of 11520x512", Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
