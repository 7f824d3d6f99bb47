// token_expand_grad, sums over blocks; see lib/token_expand_grad_params for the equations.
//
// An invocation owns a time, one of its two rows and a channel, and walks the blocks in order.
#import token_expand_grad_params
#import grid

@group(0) @binding(1) var<storage, read> parts: array<f32>;
@group(0) @binding(2) var<storage, read_write> dtime: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let width = 2u * p.d;
    if (index >= p.times * width) {
        return;
    }
    let t = index / width;
    var at = p.sums_rest + t * p.parts * width + (index - t * width);
    var sum = 0.0;
    for (var b = 0u; b < p.parts; b++) {
        sum += parts[at];
        at += width;
    }
    dtime[p.out_rest + index] = sum;
}
