// softmax over the last axis, any WebGPU device:
//
//   y[m, n] = exp(x[m, n] - max_m) / sum_n exp(x[m, n] - max_m)
//
// x, y [m, n]. An invocation owns a row and walks it three times; sums run over n in order. A row of -inf alone
// gives zeros, not NaN; +inf or NaN in a row give NaN in that row.
#import grid

// The least finite f32: the maximum of a row of -inf, so that x - max stays -inf.
const LEAST: f32 = -3.40282346e38;

struct Params {
    m: u32,
    n: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = lib_fold(group, groups) * 64u + local.x;
    if (row >= p.m) {
        return;
    }
    let first = row * p.n;
    var top = LEAST;
    for (var i = 0u; i < p.n; i++) {
        top = max(top, x[first + i]);
    }
    var sum = 0.0;
    for (var i = 0u; i < p.n; i++) {
        let e = exp(x[first + i] - top);
        y[first + i] = e;
        sum += e;
    }
    // No term at all: 0 rather than 0 / 0.
    let scale = select(1.0 / sum, 0.0, sum == 0.0);
    for (var i = 0u; i < p.n; i++) {
        y[first + i] *= scale;
    }
}
