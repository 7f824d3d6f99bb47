// deform_sample: the field and the mask of one source image blended at each pixel's sampling points, any WebGPU device:
//
//   tau[i, 9 t + c] = sum_{l, q} weights[i, l, q] B(field[l, t, :, c]),  tau[i, 9 T] = sum_{l, q} weights[i, l, q] B(mask)
//
// B is the bilinear value at the point (lib/deform_params). field [levels, T, hp * wp, 9], mask [hp * wp],
// pixels [n] flat pixel indices (absent: all), tau [n, 9 T + 1]. An invocation owns one pixel and one time, or its mask.
// No variant for GPUs: networks run `trajectory`, which never stores tau; trajectory/gpu.wgsl says what bounds both, and why
// workgroup memory, subgroups and f16 do not help. This one is for looking inside.
#import deform_field
#import deform_theta
#import grid

@group(0) @binding(1) var<storage, read> offsets: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> pixels: array<u32>;
@group(0) @binding(4) var<storage, read> field: array<f32>;
@group(0) @binding(5) var<storage, read> mask: array<f32>;
@group(0) @binding(6) var<storage, read_write> tau: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    // Neighbouring invocations are neighbouring pixels.
    let t = index / p.n;
    let i = index - t * p.n;
    if (t > p.times) {
        return;
    }
    var pixel = p.first + i;
    if ((p.flags & LISTED) != 0u) {
        pixel = pixels[p.i_rest + i];
    }
    let reference = lib_reference(pixel);
    let dest = p.y_rest + i * (p.times * 9u + 1u) + t * 9u;
    if (t == p.times) {
        tau[dest] = lib_theta(i, reference);
        return;
    }
    let sum = lib_sample(i, reference, t);
#for c in 0..3
    tau[dest + ${c}u] = sum.a[$c];
    tau[dest + ${c+3}u] = sum.b[$c];
    tau[dest + ${c+6}u] = sum.c[$c];
#end
}
