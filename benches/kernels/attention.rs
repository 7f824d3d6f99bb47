//! `attention`: one image, 4 images, 16 images at 504x280 in global attention, and local attention of 4 images.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::attention::Attention;
use omnix_kernels::run::HostArg;

/// Groups, heads, head width, queries and keys.
const SHAPES: &[(u32, u32, u32, u32)] = &[
    (1, 6, 64, 1296),
    (1, 6, 64, 5184),
    (1, 6, 64, 11_536),
    (4, 6, 64, 721),
    (1, 12, 32, 1296),
    (1, 4, 96, 1296),
    (1, 4, 128, 1296),
];

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    for &(groups, heads, head_dim, n) in SHAPES {
        let case = format!("{groups} groups, {heads} heads of {head_dim}, {n} keys");
        if !bench.wants("attention", &case) {
            continue;
        }
        let spec = Attention { groups, heads, head_dim, nq: n, nk: n };
        let (q, k, v) =
            (numbers(spec.q_words() as usize), numbers(spec.kv_words() as usize), numbers(spec.kv_words() as usize));
        let args = [
            HostArg::F32(&q),
            HostArg::F32(&k),
            HostArg::F32(&v),
            HostArg::Out(spec.out_words() as usize),
            HostArg::Out((spec.state_bytes(&bench.gpu.caps) / 4) as usize),
        ];
        bench.case("attention", &case, Work::Flops(spec.flops()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
