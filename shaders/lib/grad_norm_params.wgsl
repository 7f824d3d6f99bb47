// What the passes of `grad_norm` share: its parameters.
struct Params {
    // Numbers of a gradient in this dispatch, and of a block.
    n: u32,
    block: u32,
    // Distances of the first number of the gradient, and of the first block's place, from the start of the windows.
    x_rest: u32,
    parts_rest: u32,
    // What gradients are multiplied by before their norm is taken, and the norm that is not exceeded.
    scale: f32,
    max_norm: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
