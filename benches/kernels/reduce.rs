//! `reduce` over the last axis and over the middle one.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::reduce::{Reduce, ReduceOp};
use omnix_kernels::run::HostArg;

/// Outer, reduced, inner.
const SHAPES: &[(u32, u32, u32)] = &[(20_736, 256, 1), (16, 720, 384)];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(outer, n, inner) in SHAPES {
        for op in [ReduceOp::Mean, ReduceOp::Std] {
            let case = format!("{op:?} {outer}x{n}x{inner}");
            if !bench.wants("reduce", &case) {
                continue;
            }
            let spec = Reduce { outer, n, inner, op };
            let x = numbers((outer * n * inner) as usize);
            let args = [HostArg::F32(&x), HostArg::Out((outer * inner) as usize)];
            bench.case("reduce", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
