//! `softmax` over many short and some long rows.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::softmax::Softmax;

/// Rows and columns.
const SHAPES: &[(u32, u32)] = &[(20_736, 32), (1296, 1296)];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(m, n) in SHAPES {
        let case = format!("{m}x{n}");
        if !bench.wants("softmax", &case) {
            continue;
        }
        let spec = Softmax { m, n };
        let x = numbers(m as usize * n as usize);
        let args = [HostArg::F32(&x), HostArg::Out(x.len())];
        bench.case("softmax", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
