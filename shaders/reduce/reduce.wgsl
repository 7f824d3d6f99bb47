// reduce over the middle axis, or over blocks of it, any WebGPU device:
//
//   y[outer, part, inner] = op x[outer, part * block .. (part + 1) * block, inner]
//
// op: sum, mean, maximum, minimum, or standard deviation with divisor n - 1 (two passes; 0 for n = 1; one block). An
// invocation owns one output and walks its block in order, so the sums do not depend on the split over outer and parts, nor
// on the split of a block, where it goes on from what y holds.
#import reduce_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    if (index >= p.outer * p.parts * p.width) {
        return;
    }
    let place = index / p.width;
    let column = index - place * p.width;
    let outer = place / p.parts;
    let start = (place - outer * p.parts) * p.block;
    let count = min(p.block, p.n - start);
    let first = p.x_skip + (outer * p.n + start) * p.inner + column;
    let to = p.y_skip + place * p.inner + column;
    var sum = 0.0;
    var top = x[first];
    var least = top;
    if ((p.flags & GO_ON) != 0u) {
        let before = y[to];
        sum = before;
        top = max(top, before);
        least = min(least, before);
    }
    for (var i = 0u; i < count; i++) {
        let v = x[first + i * p.inner];
        sum += v;
        top = max(top, v);
        least = min(least, v);
    }
    var result = sum;
    switch p.op {
        case OP_MEAN: { result = sum / f32(p.divisor); }
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
    y[to] = result;
}
