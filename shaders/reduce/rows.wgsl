// reduce over blocks of a long row, any WebGPU device: y[outer, part] = op x[outer, part * block .. (part + 1) * block].
//
// op: sum, maximum or minimum. A workgroup owns a block, so that neighbouring invocations read neighbours: each takes every
// 64th number, and then halves of them are joined until one is left. The order depends on the block's length alone.
#import reduce_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;

var<workgroup> joined: array<f32, 64>;

fn join(a: f32, b: f32) -> f32 {
    switch p.op {
        case OP_MAX: { return max(a, b); }
        case OP_MIN: { return min(a, b); }
        default: { return a + b; }
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups);
    // Workgroups past the end repeat the last block and write nothing, so that barriers stay uniform.
    let place = min(index, p.outer * p.parts - 1u);
    let outer = place / p.parts;
    let start = (place - outer * p.parts) * p.block;
    let count = min(p.block, p.n - start);
    let first = p.x_skip + outer * p.n + start;
    let own = x[first + min(local.x, count - 1u)];
    // Where a block has no number for an invocation, what changes nothing: 0, or a number of the block.
    var value = select(own, select(0.0, own, local.x < count), p.op == OP_SUM || p.op == OP_MEAN);
    for (var i = local.x + 64u; i < count; i += 64u) {
        value = join(value, x[first + i]);
    }
    joined[local.x] = value;
    workgroupBarrier();
    for (var span = 32u; span > 0u; span /= 2u) {
        if (local.x < span) {
            joined[local.x] = join(joined[local.x], joined[local.x + span]);
        }
        workgroupBarrier();
    }
    if (local.x == 0u && index == place) {
        y[p.y_skip + place] = joined[0];
    }
}
