// layer_norm, GPUs with subgroups: see lib/layer_norm_params for the equation and the shapes.
//
// A workgroup of 64 owns a row and holds it in registers: invocation i has the vec4 i, i + 64, … of at most 8. A subgroup
// adds its lanes with one operation, and the sums of the subgroups, as many as there are, meet in workgroup memory. A
// row's order of summation is the device's, the same for every row. Needs c to be a multiple of 4, at most 2048.
//
// Roofline: a row is read once and written once, 8 bytes a number for about 10 operations: memory bounds by a factor of ten
// on any GPU. What counts is bytes in flight: about 56 registers leave 1024 invocations a unit, 16 rows, each with c / 256
// vec4 loads before its first barrier. Two barriers a sum instead of seven, and workgroup memory of 256 bytes.
// f16 would change nothing: x and y are f32 in memory, and that is all the time there is; halving them would halve it,
// and belongs to what writes x. A product of matrices there is none.
#import layer_norm_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> weight: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> bias: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> y: array<vec4<f32>>;

// One a subgroup; 64 would do for subgroups of one lane.
var<workgroup> partial: array<f32, 64>;

// The sum of all components of v over the workgroup. Called in uniform control flow only.
fn total(v: vec4<f32>, lane: u32, subgroup: u32, subgroups: u32) -> f32 {
    let part = subgroupAdd((v.x + v.y) + (v.z + v.w));
    workgroupBarrier();
    if (lane == 0u) {
        partial[subgroup] = part;
    }
    workgroupBarrier();
    var sum = 0.0;
    for (var s = 0u; s < subgroups; s++) {
        sum += partial[s];
    }
    return sum;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(subgroup_invocation_id) lane: u32,
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = lib_fold(group, groups);
    if (row >= p.m) {
        return;
    }
    let c4 = p.c / 4u;
    let first = row * c4;
    var sum = vec4<f32>(0.0);
#for i in 0..8
    var v$i = vec4<f32>(0.0);
    if (index + ${i*64}u < c4) {
        v$i = x[first + index + ${i*64}u];
        sum += v$i;
    }
#end
    let mean = vec4<f32>(total(sum, lane, subgroup, subgroups) / f32(p.c));
    var squares = vec4<f32>(0.0);
#for i in 0..8
    if (index + ${i*64}u < c4) {
        v$i -= mean;
        squares = fma(v$i, v$i, squares);
    }
#end
    let scale = 1.0 / sqrt(total(squares, lane, subgroup, subgroups) / f32(p.c) + p.eps);
#for i in 0..8
    if (index + ${i*64}u < c4) {
        var out = v$i * scale;
        if ((p.flags & HAS_WEIGHT) != 0u) {
            out *= weight[index + ${i*64}u];
        }
        if ((p.flags & HAS_BIAS) != 0u) {
            out += bias[index + ${i*64}u];
        }
        y[first + index + ${i*64}u] = lib_activate(out, p.act);
    }
#end
}
