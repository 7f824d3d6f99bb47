// reduce over the middle axis, any WebGPU device:
//
//   y[outer, inner] = op_n x[outer, n, inner]
//
// op: sum, mean, maximum, minimum, or standard deviation with divisor n - 1 (two passes; 0 for n = 1). An invocation
// owns one output and walks n in order, so the sums do not depend on the split over outer.
#import grid

const OP_SUM: u32 = 0u;
const OP_MEAN: u32 = 1u;
const OP_MAX: u32 = 2u;
const OP_MIN: u32 = 3u;
const OP_STD: u32 = 4u;

struct Params {
    // Rows of this dispatch.
    outer: u32,
    n: u32,
    inner: u32,
    op: u32,
    // Numbers before the first row in the bindings of x and y.
    x_skip: u32,
    y_skip: u32,
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
    let index = lib_fold(group, groups) * 64u + local.x;
    if (index >= p.outer * p.inner) {
        return;
    }
    let first = p.x_skip + index / p.inner * p.n * p.inner + index % p.inner;
    var sum = 0.0;
    var top = x[first];
    var least = top;
    for (var i = 0u; i < p.n; i++) {
        let v = x[first + i * p.inner];
        sum += v;
        top = max(top, v);
        least = min(least, v);
    }
    var result = sum;
    switch p.op {
        case OP_MEAN: { result = sum / f32(p.n); }
        case OP_MAX: { result = top; }
        case OP_MIN: { result = least; }
        case OP_STD: {
            let mean = sum / f32(p.n);
            var squares = 0.0;
            for (var i = 0u; i < p.n; i++) {
                let d = x[first + i * p.inner] - mean;
                squares += d * d;
            }
            result = sqrt(squares / f32(max(p.n, 2u) - 1u));
        }
        default: {}
    }
    y[p.y_skip + index] = result;
}
