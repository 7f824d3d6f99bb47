//! `conv2d`: the 3x3 convolutions of the dense heads, f32 and f16 weights.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::conv2d::Conv2d;
use omnix_kernels::run::HostArg;
use omnix_kernels::{Activation, KernelError, PackedWeights, WeightType};

/// Input and output channels, rows, columns, stride.
const SHAPES: &[(u32, u32, u32, u32, u32)] = &[
    (128, 64, 280, 504, 1),
    (64, 64, 160, 288, 1),
    (32, 32, 504, 280, 1),
    (256, 256, 80, 144, 1),
    (384, 384, 20, 36, 2),
    (1024, 256, 20, 36, 1),
];

/// A layer of 3x3 with ReLU before and after, and a bias.
pub(crate) fn layer([ci, co]: [u32; 2], [hi, wi]: [u32; 2], stride: u32, storage: WeightType) -> Conv2d {
    Conv2d {
        frames: 1,
        hi,
        wi,
        ci,
        kernel: [3, 3],
        stride,
        padding: 1,
        weights: PackedWeights { k: 9 * ci, n: co, storage },
        act: Activation::Relu,
        relu_input: true,
        bias: true,
        residual: false,
        residual2: false,
    }
}

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(ci, co, hi, wi, stride) in SHAPES {
        for storage in [WeightType::F32, WeightType::F16] {
            let case = format!("{ci}->{co} {hi}x{wi}/{stride} {storage:?}");
            if !bench.wants("conv2d", &case) {
                continue;
            }
            let spec = layer([ci, co], [hi, wi], stride, storage);
            let [ho, wo] = spec.output();
            let (x, w) = (numbers((hi * wi * ci) as usize), numbers((9 * ci * co) as usize));
            let packed = spec.weights.pack(|k, o| w[k * co as usize + o]);
            let args = [
                HostArg::F32(&x),
                HostArg::Bytes(&packed),
                HostArg::F32(&w[..co as usize]),
                HostArg::Out(1),
                HostArg::Out(1),
                HostArg::Out((ho * wo * co) as usize),
            ];
            bench.case("conv2d", &case, Work::Flops(spec.flops()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
