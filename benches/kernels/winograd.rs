//! `winograd` at the shapes of `conv2d`; rates are effective, by the operations of the sum over taps.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::run::HostArg;
use omnix_kernels::winograd::{PLACES, Winograd};
use omnix_kernels::{KernelError, WeightType};

use crate::conv2d::layer;

/// Input and output channels, rows, columns.
const SHAPES: &[(u32, u32, u32, u32)] = &[
    (128, 64, 280, 504),
    (64, 64, 80, 144),
    (32, 32, 504, 280),
    (128, 128, 160, 288),
    (256, 256, 80, 144),
    (1024, 256, 20, 36),
];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(ci, co, hi, wi) in SHAPES {
        let conv = layer([ci, co], [hi, wi], 1, WeightType::F32);
        let case = format!("{ci}->{co} {hi}x{wi}");
        let Some(spec) = Winograd::of(conv, &bench.gpu.caps).filter(|_| bench.wants("winograd", &case)) else {
            continue;
        };
        let x = numbers((hi * wi * ci) as usize);
        let w = numbers((PLACES * ci * co) as usize);
        let packed = spec.weights().pack(|k, o| w[k * co as usize + o]);
        let args = [
            HostArg::F32(&x),
            HostArg::Bytes(&packed),
            HostArg::F32(&w[..co as usize]),
            HostArg::Out(1),
            HostArg::Out(1),
            HostArg::Out((hi * wi * co) as usize),
            HostArg::Out(spec.scratch() as usize),
        ];
        bench.case("winograd", &case, Work::Flops(conv.flops()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
