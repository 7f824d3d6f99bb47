// resize, software devices, bilinear: see lib/resize_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns 8 neighbouring output pixels of a row: lane j finds the
// columns of pixel j, then all lanes walk the channels together as vec4. Source columns are blended
// vertically first, so that neighbours that lie between the same columns share them: loads cost more than
// anything else. Needs c to be a multiple of 4.
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
    let eights = (p.wo + 7u) / 8u;
    let tile = lib_fold(group, groups);
    // Output rows of all frames in order.
    let line = tile / eights;
    if (line * p.wo >= p.pixels) {
        return;
    }
    let first = (tile - line * eights) * 8u;
    let rows = p.frame_pixels / p.wo;
    let frame = line / rows;
    let row = line - frame * rows;
    let v = lib_coordinate(p.oy0 + row, p.y_a, p.y_b, p.y_d);
    // Pixels past the row's end compute the last one; they are not written.
    let h = lib_coordinate(min(first + lane, p.wo - 1u), p.x_a, p.x_b, p.x_d);
    let left = u32(min(h.cell, i32(p.wi) - 1)) * p.c;
    let right = u32(min(h.cell + 1, i32(p.wi) - 1)) * p.c;
    let top = p.x_rest + (frame * p.hi + u32(min(v.cell, i32(p.hi) - 1)) - p.iy0) * p.wi * p.c;
    let bottom = p.x_rest + (frame * p.hi + u32(min(v.cell + 1, i32(p.hi) - 1)) - p.iy0) * p.wi * p.c;
#for q in 0..8
    let l$q = subgroupShuffle(left, ${q}u);
    let r$q = subgroupShuffle(right, ${q}u);
    let t$q = subgroupShuffle(h.fraction, ${q}u);
#end
    let count = min(8u, p.wo - first);
    let dest = p.y_rest + (line * p.wo + first) * p.c;
    let extra = p.add_rest + (row * p.wo + first) * p.c;
    for (var c = lane; c < p.c; c += 8u) {
        var a = mix(x[top + l0 + c], x[bottom + l0 + c], v.fraction);
        var b = mix(x[top + r0 + c], x[bottom + r0 + c], v.fraction);
#for q in 0..8
#if q
        if (l$q != l${q-1}) {
            if (l$q == r${q-1}) {
                a = b;
            } else {
                a = mix(x[top + l$q + c], x[bottom + l$q + c], v.fraction);
            }
        }
        if (r$q != r${q-1}) {
            b = mix(x[top + r$q + c], x[bottom + r$q + c], v.fraction);
        }
#endif
        if (${q}u < count) {
            var sum = mix(a, b, t$q);
            if (p.has_add != 0u) {
                sum += add[extra + ${q}u * p.c + c];
            }
            y[dest + ${q}u * p.c + c] = sum;
        }
#end
    }
}
