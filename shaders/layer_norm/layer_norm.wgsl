// layer_norm, any WebGPU device: see lib/layer_norm_params for the equation and the shapes.
//
// An invocation owns a row and walks it three times (mean, squared differences, result). Any c.
#import layer_norm_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> weight: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read_write> y: array<f32>;

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
    let first = row * p.c;
    var sum = 0.0;
    for (var i = 0u; i < p.c; i++) {
        sum += x[first + i];
    }
    let mean = sum / f32(p.c);
    var squares = 0.0;
    for (var i = 0u; i < p.c; i++) {
        let d = x[first + i] - mean;
        squares += d * d;
    }
    let scale = 1.0 / sqrt(squares / f32(p.c) + p.eps);
    for (var i = 0u; i < p.c; i++) {
        var v = (x[first + i] - mean) * scale;
        if ((p.flags & HAS_WEIGHT) != 0u) {
            v *= weight[i];
        }
        if ((p.flags & HAS_BIAS) != 0u) {
            v += bias[i];
        }
        y[first + i] = lib_activate(vec4<f32>(v), p.act).x;
    }
}
