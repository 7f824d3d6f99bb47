// conv2d_weights, the sums of sections added in order and laid out as checkpoints have weights, any WebGPU device:
//
//   dw[o, c, tap] = ((sums[0, tap, o, c] + sums[1, tap, o, c]) + ..)
//
// An invocation owns a number of dw; the sums of neighbouring taps lie co ci apart. With GO_ON the sums go on from what dw holds.
#import conv2d_weights_params
#import grid

@group(0) @binding(1) var<storage, read> sums: array<f32>;
@group(0) @binding(2) var<storage, read_write> dw: array<f32>;

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
    let o_and_c = i / p.taps;
    let tap = i - o_and_c * p.taps;
    var at = p.x_rest + tap * p.co * p.ci + o_and_c;
    var sum = 0.0;
    var start = 0u;
    if ((p.flags & GO_ON) != 0u) {
        sum = dw[p.out_rest + i];
    } else {
        sum = sums[at];
        at += p.out_step;
        start = 1u;
    }
    for (var section = start; section < p.count; section++) {
        sum += sums[at];
        at += p.out_step;
    }
    dw[p.out_rest + i] = sum;
}
