//! `split_heads`: q (norm, RoPE), k (the same, key blocks) and v of 4 images at 504x280 in the small network.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::run::HostArg;
use omnix_kernels::split_heads::{HeadLayout, SplitHeads};

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let (tokens, heads, head_dim) = (721, 6, 64);
    let x_stride = 3 * heads * head_dim;
    let v = SplitHeads {
        groups: 4,
        tokens,
        heads,
        head_dim,
        x_stride,
        x_offset: 2 * heads * head_dim,
        norm: None,
        rope_rows: None,
        scale: 1.0,
        layout: HeadLayout::Rows,
    };
    let q = SplitHeads { x_offset: 0, norm: Some(1e-5), rope_rows: Some(tokens), scale: 0.125, ..v };
    let k = SplitHeads { x_offset: heads * head_dim, layout: HeadLayout::KeyBlocks, ..q };
    let x = numbers((v.groups * tokens * x_stride) as usize);
    let (weight, table) = (numbers(head_dim as usize), numbers((tokens * head_dim) as usize));
    for (name, spec) in [("q", q), ("k", k), ("v", v)] {
        let case = format!("{name}, 4 x 721 tokens, 6 heads of 64");
        if !bench.wants("split_heads", &case) {
            continue;
        }
        let args = [
            HostArg::F32(&x),
            HostArg::F32(&weight),
            HostArg::F32(&weight),
            HostArg::F32(&table),
            HostArg::Out(spec.words() as usize),
        ];
        bench.case("split_heads", &case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
    }
    Ok(())
}
