// layer_norm_grad, rows, any WebGPU device: see lib/layer_norm_grad_params for the equations and the shapes.
//
// An invocation owns a row and walks it four times (mean, squared differences, the two sums of gradients, result). Any c.
#import layer_norm_grad_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> weight: array<f32>;
@group(0) @binding(3) var<storage, read> dy: array<f32>;
@group(0) @binding(4) var<storage, read_write> dx: array<f32>;
@group(0) @binding(5) var<storage, read_write> stats: array<vec2<f32>>;

fn gradient(at: u32, i: u32) -> f32 {
    let d = dy[at + i];
    if ((p.flags & HAS_WEIGHT) != 0u) {
        return d * weight[i];
    }
    return d;
}

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
    let at = row * p.c;
    var sum = 0.0;
    for (var i = 0u; i < p.c; i++) {
        sum += x[at + i];
    }
    let mean = sum / f32(p.c);
    var squares = 0.0;
    for (var i = 0u; i < p.c; i++) {
        let d = x[at + i] - mean;
        squares += d * d;
    }
    let scale = 1.0 / sqrt(squares / f32(p.c) + p.eps);
    stats[row] = vec2<f32>(mean, scale);
    var plain = 0.0;
    var along = 0.0;
    for (var i = 0u; i < p.c; i++) {
        let g = gradient(at, i);
        plain += g;
        along += g * ((x[at + i] - mean) * scale);
    }
    plain /= f32(p.c);
    along /= f32(p.c);
    for (var i = 0u; i < p.c; i++) {
        let n = (x[at + i] - mean) * scale;
        dx[at + i] = scale * ((gradient(at, i) - plain) - n * along);
    }
}
