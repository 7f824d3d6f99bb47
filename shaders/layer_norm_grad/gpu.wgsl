// layer_norm_grad, rows, GPUs: see lib/layer_norm_grad_params for the equations and the shapes.
//
// A workgroup of 64 owns a row; invocation i takes the channels i, i + 64, .., and a tree in workgroup memory adds the 64
// sums. Any c. Bound by memory: x and dy are read once from memory and, a row being small, again from a cache; 12 bytes a number.
#import layer_norm_grad_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> weight: array<f32>;
@group(0) @binding(3) var<storage, read> dy: array<f32>;
@group(0) @binding(4) var<storage, read_write> dx: array<f32>;
@group(0) @binding(5) var<storage, read_write> stats: array<vec2<f32>>;

var<workgroup> partial: array<vec2<f32>, 64>;

// The sums of v over the workgroup. Called in uniform control flow only.
fn total(v: vec2<f32>, index: u32) -> vec2<f32> {
    workgroupBarrier();
    partial[index] = v;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if (index < half) {
            partial[index] += partial[index + half];
        }
        workgroupBarrier();
    }
    return partial[0];
}

fn gradient(at: u32, i: u32) -> f32 {
    let d = dy[at + i];
    if ((p.flags & HAS_WEIGHT) != 0u) {
        return d * weight[i];
    }
    return d;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = lib_fold(group, groups);
    if (row >= p.m) {
        return;
    }
    let at = row * p.c;
    var sum = 0.0;
    for (var i = index; i < p.c; i += 64u) {
        sum += x[at + i];
    }
    let mean = total(vec2<f32>(sum, 0.0), index).x / f32(p.c);
    var squares = 0.0;
    for (var i = index; i < p.c; i += 64u) {
        let d = x[at + i] - mean;
        squares += d * d;
    }
    let scale = 1.0 / sqrt(total(vec2<f32>(squares, 0.0), index).x / f32(p.c) + p.eps);
    var sums = vec2<f32>(0.0);
    for (var i = index; i < p.c; i += 64u) {
        let g = gradient(at, i);
        sums += vec2<f32>(g, g * ((x[at + i] - mean) * scale));
    }
    let means = total(sums, index) / f32(p.c);
    for (var i = index; i < p.c; i += 64u) {
        let n = (x[at + i] - mean) * scale;
        dx[at + i] = scale * ((gradient(at, i) - means.x) - n * means.y);
    }
    if (index == 0u) {
        stats[row] = vec2<f32>(mean, scale);
    }
}
