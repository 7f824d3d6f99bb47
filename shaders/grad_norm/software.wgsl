// grad_norm, squares of a gradient, software devices: parts[block] = sum over the block of (scale x)^2, the number of numbers a
// multiple of 4.
//
// A workgroup is one subgroup of 8 lanes and owns a block. A lane takes every 8th four of it, as two 64-bit words, in the order of
// memory; constant shuffles join the lanes.
#import grad_norm_params
#import grid
#import lanes
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read_write> parts: array<f32>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups);
    let start = index * p.block;
    if (start >= p.n) {
        return;
    }
    let count = min(p.block, p.n - start) / 4u;
    let first = (p.x_rest + start) / 4u;
    let scale = p.scale;
    var sum = Value();
    for (var i = local.x; i < count; i += 8u) {
        let v = scale * lib_value(x[first + i]);
        sum = fma(v, v, sum);
    }
    parts[p.parts_rest + index] = lib_total((sum.x + sum.y) + (sum.z + sum.w));
}
