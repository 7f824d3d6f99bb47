// What the forms of `reduce` share: parameters and the operations by number; the host's `ReduceOp` has the same order.
const OP_SUM: u32 = 0u;
const OP_MEAN: u32 = 1u;
const OP_MAX: u32 = 2u;
const OP_MIN: u32 = 3u;
const OP_STD: u32 = 4u;

// Whether y holds what came before the first element.
const GO_ON: u32 = 1u;

struct Params {
    // Rows of x and of y before the reduced axis, elements of that axis, and numbers from one of them to the next.
    outer: u32,
    n: u32,
    inner: u32,
    op: u32,
    // Numbers before the first element in the bindings of x and y.
    x_skip: u32,
    y_skip: u32,
    // Elements of a block, blocks of the axis, and the columns of inner that this dispatch owns.
    block: u32,
    parts: u32,
    width: u32,
    // What the sum of a mean is divided by.
    divisor: u32,
    flags: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
