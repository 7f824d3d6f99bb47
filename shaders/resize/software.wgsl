// resize, software devices, bilinear: see lib/resize_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $STRIP neighbouring output pixels of a row: for 8 lanes of four channels at
// a time it walks along the row. Source columns are blended vertically first and kept, so that output pixels that lie
// between the same columns, and the next two columns after them, share the loads: those cost more than anything else.
// Needs c to be a multiple of 4.
#import resize_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<storage, read> add: array<Quad>;
@group(0) @binding(3) var<storage, read_write> y: array<Quad>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let strips = (p.wo + ${STRIP-1}u) / ${STRIP}u;
    let tile = lib_fold(group, groups);
    // Output rows of all frames in order.
    let line = tile / strips;
    if (line * p.wo >= p.pixels) {
        return;
    }
    let first = (tile - line * strips) * ${STRIP}u;
    let count = min(${STRIP}u, p.wo - first);
    let rows = p.frame_pixels / p.wo;
    let frame = line / rows;
    let row = line - frame * rows;
    let v = lib_coordinate(p.oy0 + row, p.y_a, p.y_b, p.y_d);
    let last = p.wi - 1u;
    let top = p.x_rest + (frame * p.hi + u32(min(v.cell, i32(p.hi) - 1)) - p.iy0) * p.wi * p.c;
    let bottom = p.x_rest + (frame * p.hi + u32(min(v.cell + 1, i32(p.hi) - 1)) - p.iy0) * p.wi * p.c;
    // The horizontal coordinate of lib_coordinate, from pixel to pixel without a division.
    let n0 = first * p.x_a + p.x_b;
    let whole = p.x_a / p.x_d;
    let part = p.x_a - whole * p.x_d;
    for (var c = lane; c < p.c; c += 8u) {
        var cell1 = n0 / p.x_d;
        var over = n0 - cell1 * p.x_d;
        var dest = p.y_rest + (line * p.wo + first) * p.c + c;
        var extra = p.add_rest + (row * p.wo + first) * p.c + c;
        // The columns a and b are of; none yet.
        var left = 0xffffffffu;
        var right = 0xffffffffu;
        var a = vec4<f32>(0.0);
        var b = vec4<f32>(0.0);
        for (var o = 0u; o < count; o++) {
            // Coordinates are one cell up, so that none is negative; those before the first column count as the first.
            let l = min(max(cell1, 1u) - 1u, last);
            let r = min(max(cell1, 1u), last);
            let t = select(f32(over) / f32(p.x_d), 0.0, cell1 == 0u);
            if (l != left) {
                if (l == right) {
                    a = b;
                } else {
                    let at = l * p.c + c;
                    a = mix(lib_quad(x[top + at]), lib_quad(x[bottom + at]), v.fraction);
                }
                left = l;
            }
            if (r != right) {
                let at = r * p.c + c;
                b = mix(lib_quad(x[top + at]), lib_quad(x[bottom + at]), v.fraction);
                right = r;
            }
            var sum = mix(a, b, t);
            if (p.has_add != 0u) {
                sum += lib_quad(add[extra]);
                extra += p.c;
            }
            y[dest] = lib_to_quad(sum);
            dest += p.c;
            cell1 += whole;
            over += part;
            if (over >= p.x_d) {
                over -= p.x_d;
                cell1 += 1u;
            }
        }
    }
}
