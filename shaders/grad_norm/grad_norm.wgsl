// grad_norm, squares of a gradient: parts[block] = sum over the block of (scale x)^2.
//
// A workgroup owns a block: each invocation every 64th number, then halves of their sums are joined until one is left.
// `reduce` adds the parts of all gradients; clip.wgsl makes the factor.
#import grad_norm_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> parts: array<f32>;

var<workgroup> joined: array<f32, 64>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups);
    let blocks = (p.n + p.block - 1u) / p.block;
    let start = index * p.block;
    let end = min(start + p.block, p.n);
    var sum = 0.0;
    // Workgroups past the end have nothing to add, and write nothing.
    for (var i = start + local.x; i < end; i += 64u) {
        let v = p.scale * x[p.x_rest + i];
        sum = fma(v, v, sum);
    }
    joined[local.x] = sum;
    workgroupBarrier();
    for (var span = 32u; span > 0u; span /= 2u) {
        if (local.x < span) {
            joined[local.x] += joined[local.x + span];
        }
        workgroupBarrier();
    }
    if (local.x == 0u && index < blocks) {
        parts[p.parts_rest + index] = joined[0];
    }
}
