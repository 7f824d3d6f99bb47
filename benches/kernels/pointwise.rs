//! `pointwise`: cheap and costly operations over maps.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::pointwise::{Binary, Operand, Pointwise, Unary};
use omnix_kernels::run::HostArg;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let (m, c) = (1 << 16, 64);
    let n = m * c;
    let cases = [
        ("scale 4M", Pointwise::unary(n, Unary::ScaleShift { s: 0.5, t: 1.0 })),
        ("gelu 4M", Pointwise::unary(n, Unary::Gelu)),
        ("exp clamped 4M", Pointwise::unary(n, Unary::ExpClamped { low: -10.0, high: 10.0 })),
        ("add same 4M", Pointwise::binary(n, Binary::Add, Operand::same(n))),
        ("mul row 65536x64", Pointwise::binary(n, Binary::Mul, Operand::row(c))),
        ("mul column 65536x64", Pointwise::binary(n, Binary::Mul, Operand::column(m, c))),
        ("scale 4M-1", Pointwise::unary(n - 1, Unary::ScaleShift { s: 0.5, t: 1.0 })),
    ];
    for (case, spec) in cases {
        if bench.wants("pointwise", case) {
            let x = numbers(n as usize);
            let args = [HostArg::F32(&x), HostArg::F32(&x), HostArg::Out(x.len())];
            bench.case("pointwise", case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
