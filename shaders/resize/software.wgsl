// resize, software devices, bilinear: see lib/resize_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns 8 output pixels: lane j finds the taps of pixel j, then
// all lanes walk the channels of each pixel together as vec4. Needs c to be a multiple of 4.
#import resize_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> add: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> y: array<vec4<f32>>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let first = lib_fold(group, groups) * 8u;
    if (first >= p.pixels) {
        return;
    }
    // Pixels past the end compute the last one; they are not written.
    let pixel = min(first + lane, p.pixels - 1u);
    let frame = pixel / p.frame_pixels;
    let inside = pixel - frame * p.frame_pixels;
    let row = inside / p.wo;
    let v = lib_coordinate(p.oy0 + row, p.y_a, p.y_b, p.y_d);
    let h = lib_coordinate(inside - row * p.wo, p.x_a, p.x_b, p.x_d);
    let top = frame * p.hi + u32(min(v.cell, i32(p.hi) - 1)) - p.iy0;
    let bottom = frame * p.hi + u32(min(v.cell + 1, i32(p.hi) - 1)) - p.iy0;
    let left = u32(min(h.cell, i32(p.wi) - 1));
    let right = u32(min(h.cell + 1, i32(p.wi) - 1));
    let i00 = p.x_rest + (top * p.wi + left) * p.c;
    let i01 = p.x_rest + (top * p.wi + right) * p.c;
    let i10 = p.x_rest + (bottom * p.wi + left) * p.c;
    let i11 = p.x_rest + (bottom * p.wi + right) * p.c;
    let extra = p.add_rest + inside * p.c;
#for q in 0..8
    {
        let a00 = subgroupShuffle(i00, ${q}u);
        let a01 = subgroupShuffle(i01, ${q}u);
        let a10 = subgroupShuffle(i10, ${q}u);
        let a11 = subgroupShuffle(i11, ${q}u);
        let across = subgroupShuffle(h.fraction, ${q}u);
        let down = subgroupShuffle(v.fraction, ${q}u);
        let plus = subgroupShuffle(extra, ${q}u);
        if (first + ${q}u < p.pixels) {
            let to = p.y_rest + (first + ${q}u) * p.c;
            for (var c = lane; c < p.c; c += 8u) {
                var sum = mix(mix(x[a00 + c], x[a01 + c], across), mix(x[a10 + c], x[a11 + c], across), down);
                if (p.has_add != 0u) {
                    sum += add[plus + c];
                }
                y[to + c] = sum;
            }
        }
    }
#end
}
