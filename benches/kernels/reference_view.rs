//! `reference_view`: the class tokens of few and of many views.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::reference_view::{ReferenceView, Strategy};
use omnix_kernels::run::HostArg;

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for s in [8u32, 256] {
        let (c, strategy) = (1024, Strategy::SaddleBalanced);
        let case = format!("{s}x{c}");
        if bench.wants("reference_view", &case) {
            let spec = ReferenceView { s, c, strategy };
            let x = numbers((s * c) as usize);
            let args = [HostArg::F32(&x), HostArg::Out(s as usize), HostArg::Out(s as usize), HostArg::Out(1)];
            // Every pair of tokens, two products each.
            let flops = 4 * u64::from(s) * u64::from(s) * u64::from(c);
            bench.case("reference_view", &case, Work::Flops(flops), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
