//! `copy`: the permutations, concatenations and rearrangements of the networks.

use omnix_benches::{Bench, Work, numbers};
use omnix_kernels::KernelError;
use omnix_kernels::copy::{Copy, Strided};
use omnix_kernels::run::HostArg;

/// A permutation of a contiguous shape, written contiguously.
fn permutation(shape: [u32; 6], order: [usize; 6]) -> Copy {
    let from = Strided::contiguous(shape);
    let shape = order.map(|d| shape[d]);
    Copy { shape, src: Strided { offset: 0, strides: order.map(|d| from.strides[d]) }, dst: Strided::contiguous(shape) }
}

pub(crate) fn run(bench: &Bench) -> Result<(), KernelError> {
    let half = Copy {
        shape: [1, 1, 1, 1, 5760, 384],
        src: Strided::contiguous([1, 1, 1, 1, 5760, 384]),
        dst: Strided { offset: 384, strides: [0, 0, 0, 0, 768, 1] },
    };
    let cases = [
        ("whole 4M", permutation([1, 1, 1, 1, 1, 1 << 22], [0, 1, 2, 3, 4, 5])),
        ("concatenate 5760x384 of 768", half),
        ("depth to space 20x36x4x4x48 x8", permutation([8, 20, 36, 4, 4, 48], [0, 1, 3, 2, 4, 5])),
        ("heads to tokens 6x5760x64", permutation([1, 1, 1, 6, 5760, 64], [0, 1, 2, 4, 3, 5])),
        ("patches 280x504x3", permutation([1, 20, 14, 36, 14, 3], [0, 1, 3, 2, 4, 5])),
        ("transpose 2000x1000", permutation([1, 1, 1, 1, 2000, 1000], [0, 1, 2, 3, 5, 4])),
    ];
    for (case, spec) in cases {
        if bench.wants("copy", case) {
            let x = numbers(spec.elements() as usize);
            let args = [HostArg::F32(&x), HostArg::Out(2 * x.len())];
            bench.case("copy", case, Work::Bytes(spec.bytes()), &spec.record(&bench.gpu.caps)?, &args)?;
        }
    }
    Ok(())
}
