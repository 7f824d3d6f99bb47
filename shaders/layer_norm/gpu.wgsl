// layer_norm, GPUs: see lib/layer_norm_params for the equation and the shapes.
//
// A workgroup of 64 owns a row; invocation i takes the channels i, i + 64, …, and a tree in workgroup
// memory adds the 64 sums. Any c. Bound by memory: the row is read three times, twice from cache.
#import layer_norm_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> weight: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read_write> y: array<f32>;

var<workgroup> partial: array<f32, 64>;

// The sum of v over the workgroup. Called in uniform control flow only.
fn total(v: f32, index: u32) -> f32 {
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
    let first = row * p.c;
    var sum = 0.0;
    for (var i = index; i < p.c; i += 64u) {
        sum += x[first + i];
    }
    let mean = total(sum, index) / f32(p.c);
    var squares = 0.0;
    for (var i = index; i < p.c; i += 64u) {
        let d = x[first + i] - mean;
        squares += d * d;
    }
    let scale = 1.0 / sqrt(total(squares, index) / f32(p.c) + p.eps);
    for (var i = index; i < p.c; i += 64u) {
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
