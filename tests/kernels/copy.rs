//! `copy` against its oracle.

use omnix_kernels::copy::{Copy, Strided, Y};
use omnix_kernels::readback::read;
use omnix_kernels::run::{HostArg, execute, upload};
use omnix_kernels::{Gpu, cpu};
use omnix_tests::{Trial, gpu, trials, with_max_binding};

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "copy",
        tiers: [permutations_and_whole_copies, slices_concatenations_and_broadcasts_leave_the_rest_alone, depth_to_space_and_patches, splitting_at_the_binding_limit_moves_the_same_words],
        once: [nothing_to_copy_and_double_writes],
    )
}

/// Runs `spec` from `x_len` numbered words into `y_len` words and compares bit for bit.
fn check(gpu: &Gpu, spec: &Copy, x_len: usize, y_len: usize) -> usize {
    let x: Vec<u32> = (0..x_len as u32).map(|i| i.wrapping_mul(0x9e37_79b9)).collect();
    let mut want = vec![0xffff_ffff; y_len];
    cpu::copy(spec, &x, &mut want);
    let slices = upload(gpu, &[HostArg::U32(&x), HostArg::Out(y_len)]).expect("uploads");
    let dispatches = spec.record(&gpu.caps).expect("records");
    execute(gpu, &dispatches, &slices).expect("runs");
    let got: Vec<u32> = read(gpu, &slices[usize::from(Y.0)]).expect("reads");
    assert!(got == want, "{spec:?}: first difference at {:?}", got.iter().zip(&want).position(|(g, w)| g != w));
    dispatches.len()
}

/// The permutation `order` of a contiguous `shape`, outermost first; written contiguously.
fn permutation(shape: [u32; 6], order: [usize; 6]) -> Copy {
    let from = Strided::contiguous(shape);
    let shape = order.map(|d| shape[d]);
    Copy { shape, src: Strided { offset: 0, strides: order.map(|d| from.strides[d]) }, dst: Strided::contiguous(shape) }
}

fn size(shape: [u32; 6]) -> usize {
    shape.iter().map(|&n| n as usize).product()
}

fn permutations_and_whole_copies(gpu: &Gpu) {
    let shapes = [
        [1; 6],
        [1, 1, 1, 1, 1, 1000],
        [2, 3, 4, 5, 6, 7],
        [1, 1, 3, 20, 36, 64],
        [1, 1, 1, 65, 33, 3],
        [5, 1, 2, 1, 9, 8],
    ];
    let orders = [[0, 1, 2, 3, 4, 5], [5, 4, 3, 2, 1, 0], [0, 1, 3, 2, 4, 5], [1, 0, 2, 3, 5, 4], [0, 5, 3, 4, 1, 2]];
    for shape in shapes {
        for order in orders {
            check(gpu, &permutation(shape, order), size(shape), size(shape));
        }
    }
}

fn slices_concatenations_and_broadcasts_leave_the_rest_alone(gpu: &Gpu) {
    // Channels 3..8 of [7, 9, 11] into channels 2..7 of [7, 9, 13], and the aligned neighbour.
    for (width, from, count, wide, to) in [(11, 3, 5, 13, 2), (16, 4, 8, 32, 24), (64, 0, 64, 128, 64), (6, 2, 4, 8, 4)]
    {
        let spec = Copy {
            shape: [1, 1, 1, 7, 9, count],
            src: Strided { offset: from, strides: [0, 0, 0, 9 * width, width, 1] },
            dst: Strided { offset: to, strides: [0, 0, 0, 9 * wide, wide, 1] },
        };
        check(gpu, &spec, 63 * width as usize, 63 * wide as usize + 5);
    }
    // A row of 12 repeated over 5 x 3 rows; a single number repeated 37 times.
    let row = Copy {
        shape: [1, 1, 1, 5, 3, 12],
        src: Strided { offset: 0, strides: [0, 0, 0, 0, 0, 1] },
        dst: Strided { offset: 0, strides: [0, 0, 0, 36, 12, 1] },
    };
    check(gpu, &row, 12, 180);
    let number = Copy {
        shape: [1, 1, 1, 1, 1, 37],
        src: Strided { offset: 2, strides: [0; 6] },
        dst: Strided { offset: 1, strides: [0, 0, 0, 0, 0, 1] },
    };
    check(gpu, &number, 3, 40);
}

fn depth_to_space_and_patches(gpu: &Gpu) {
    // [h, w, i, j, c] of a transposed convolution to [h i, w j, c].
    let (h, w, k, c) = (5, 6, 2, 12);
    check(
        gpu,
        &permutation([1, h, w, k, k, c], [0, 1, 3, 2, 4, 5]),
        size([1, h, w, k, k, c]),
        size([1, h, w, k, k, c]),
    );
    // Image [h p, w p, 3] to patches [h, w, p, p, 3].
    check(gpu, &permutation([1, 4, 14, 5, 14, 3], [0, 1, 3, 2, 4, 5]), 4 * 14 * 5 * 14 * 3, 4 * 14 * 5 * 14 * 3);
}

fn splitting_at_the_binding_limit_moves_the_same_words(gpu: &Gpu) {
    let small = with_max_binding(gpu, 4096);
    for (shape, order) in [
        ([1, 1, 3, 20, 36, 8], [0, 1, 4, 2, 3, 5]),
        ([1, 1, 1, 1, 1, 20_000], [0, 1, 2, 3, 4, 5]),
        ([1, 1, 1, 1, 70, 90], [0, 1, 2, 3, 5, 4]),
        ([1, 1, 1, 31, 7, 13], [0, 1, 2, 5, 4, 3]),
    ] {
        let count = check(&small, &permutation(shape, order), size(shape), size(shape));
        assert!(count > 4, "{shape:?} took {count} dispatches");
    }
}

fn nothing_to_copy_and_double_writes() {
    let mut spec = permutation([1, 1, 1, 1, 4, 4], [0, 1, 2, 3, 4, 5]);
    spec.dst.strides[4] = 0;
    let error = spec.record(&gpu().caps).expect_err("writes twice");
    assert!(error.to_string().contains("writes an element twice"), "{error}");
    spec.shape[5] = 0;
    assert!(spec.record(&gpu().caps).expect("records").is_empty());
}
