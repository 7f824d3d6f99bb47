// linear_weights, the sums of sections added in order, any WebGPU device; other kernels with long sums use it too:
//
//   out[i] = ((x[0, i] + x[1, i]) + x[2, i]) + ..        with GO_ON from what out holds
//
// An invocation owns a number (lib/value: four of them).
#import linear_weights_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read_write> out: array<Stored>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    if (i >= p.len) {
        return;
    }
    var at = p.in_rest + i;
    var sum = Value();
    var first = 0u;
    if ((p.flags & GO_ON) != 0u) {
        sum = lib_value(out[p.out_rest + i]);
    } else {
        sum = lib_value(x[at]);
        at += p.out_step;
        first = 1u;
    }
    for (var section = first; section < p.count; section++) {
        sum += lib_value(x[at]);
        at += p.out_step;
    }
    out[p.out_rest + i] = lib_stored(sum);
}
