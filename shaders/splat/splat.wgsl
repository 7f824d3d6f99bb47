// splat: coloured points as discs that close holes, seen by a pinhole camera: y [height, width, 4], red, green, blue and cover from
// 0 to 1, colours times cover, over a background.
//
// Surface splatting in three steps (Zwicker et al., "Surface Splatting", 2001, with shares in place of Gaussians): `depth.wgsl`
// finds the nearest disc at four samples of each pixel, `blend.wgsl` mixes the discs of that surface, and this, the last, makes
// pixels of the sums: the mean colour of the front surfaces, in as much of the pixel as has samples with one. One pixel an invocation.
#import splat_params
#import grid

@group(0) @binding(1) var<storage, read> view: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> depth: array<vec4<u32>>;
@group(0) @binding(3) var<storage, read> sums: array<vec4<u32>>;
@group(0) @binding(4) var<storage, read_write> y: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    if (i >= p.width * p.rows) {
        return;
    }
    let sum = sums[i];
    var pixel = view[5];
    // Another compilation of the same test may have found no sample where the first pass found one.
    if (sum.w > 0u) {
        let filled = select(vec4<f32>(0.0), vec4<f32>(0.25), depth[i] != vec4<u32>(LIB_EMPTY));
        let cover = filled.x + filled.y + filled.z + filled.w;
        let mean = vec4<f32>(sum) / f32(sum.w);
        pixel = vec4<f32>(mean.xyz / 255.0, 1.0) * cover + pixel * (1.0 - cover);
    }
    let at = p.y_rest + 4u * i;
    y[at] = pixel.x;
    y[at + 1u] = pixel.y;
    y[at + 2u] = pixel.z;
    y[at + 3u] = pixel.w;
}
