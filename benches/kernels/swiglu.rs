//! `swiglu` over the tokens of the largest network.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::swiglu::SwiGlu;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let spec = SwiGlu { m: 1442, h: 4096 };
    if bench.wants("swiglu", "1442x4096") {
        let x = numbers((spec.m * spec.h * 2) as usize);
        let args = [HostArg::F32(&x), HostArg::Out(x.len() / 2)];
        bench.case("swiglu", "1442x4096", Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
