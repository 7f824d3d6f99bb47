// reduce over blocks of a long row, software devices: y[outer, part] = sum x[outer, part * block .. (part + 1) * block], the row's
// length a multiple of 4.
//
// A workgroup is one subgroup of 8 lanes and owns a block. A lane takes every 8th four of it, as two 64-bit words, in the order of
// memory; constant shuffles join the lanes. The order depends on the block's length alone.
#import reduce_params
#import grid
#import lanes
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let place = lib_fold(group, groups);
    if (place >= p.outer * p.parts) {
        return;
    }
    let outer = place / p.parts;
    let start = (place - outer * p.parts) * p.block;
    let count = min(p.block, p.n - start) / 4u;
    let first = (p.x_skip + outer * p.n + start) / 4u;
    var sum = Value();
    for (var i = local.x; i < count; i += 8u) {
        sum += lib_value(x[first + i]);
    }
    y[p.y_skip + place] = lib_total((sum.x + sum.y) + (sum.z + sum.w));
}
