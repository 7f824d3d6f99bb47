//! `token_expand`: chosen tokens times target times.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::token_expand::TokenExpand;

/// Times, tokens, channels.
const SHAPES: &[(u32, u32, u32)] = &[(16, 2304, 512), (16, 192, 192)];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(times, m, d) in SHAPES {
        let case = format!("{times}x{m}x{d}");
        if !bench.wants("token_expand", &case) {
            continue;
        }
        let spec = TokenExpand { m, d, times, scale: false, alpha: false, kappa: true };
        let (q, shift, gain) = (numbers((m * d) as usize), numbers((times * d) as usize), numbers(m as usize));
        let args = [
            HostArg::F32(&q),
            HostArg::Out(1),
            HostArg::F32(&shift),
            HostArg::Out(1),
            HostArg::F32(&gain),
            HostArg::Out((times * m * d) as usize),
        ];
        bench.case("token_expand", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
