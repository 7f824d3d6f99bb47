//! `linear`: the products of the small and large networks, f32, f16 and int8 weights.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::linear::Linear;
use omnix_kernels::run::HostArg;
use omnix_kernels::{Activation, KernelError, PackedWeights, WeightType};

/// Rows, columns, depth.
const SHAPES: &[(u32, u32, u32)] = &[
    (1296, 1152, 384),
    (1296, 1536, 384),
    (1296, 384, 1536),
    (4096, 3072, 1024),
    (20_736, 512, 512),
    (141_120, 2, 32),
];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(m, n, k) in SHAPES {
        for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
            let case = format!("{m}x{n}x{k} {storage:?}");
            if !bench.wants("linear", &case) {
                continue;
            }
            let weights = PackedWeights { k, n, storage };
            let spec = Linear { m, weights, act: Activation::None, bias: true, gamma: false, residual: false };
            let (x, w, bias) =
                (numbers(m as usize * k as usize), numbers(n as usize * k as usize), numbers(n as usize));
            let packed = weights.pack(|row, column| w[column * k as usize + row]);
            let args = [
                HostArg::F32(&x),
                HostArg::Bytes(&packed),
                HostArg::F32(&bias),
                HostArg::Out(1),
                HostArg::Out(1),
                HostArg::Out(m as usize * n as usize),
            ];
            bench.case("linear", &case, Work::Flops(spec.flops()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
