//! `layer_norm` over the tokens of the small and large networks.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::layer_norm::LayerNorm;
use omnix_kernels::run::HostArg;
use omnix_kernels::{Activation, KernelError};

/// Rows and channels.
const SHAPES: &[(u32, u32)] = &[(1296, 384), (5184, 1024), (20_736, 1024)];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(m, c) in SHAPES {
        let case = format!("{m}x{c}");
        if !bench.wants("layer_norm", &case) {
            continue;
        }
        let spec = LayerNorm { m, c, eps: 1e-6, act: Activation::None, weight: true, bias: true };
        let (x, weight) = (numbers(m as usize * c as usize), numbers(c as usize));
        let args = [HostArg::F32(&x), HostArg::F32(&weight), HostArg::F32(&weight), HostArg::Out(x.len())];
        bench.case("layer_norm", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
