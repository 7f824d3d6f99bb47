// resize, software devices, bicubic without a code: see lib/resize_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and walks along $STRIP columns of a row of y, p.lanes lanes of channels (lib/value) at a
// time; where those are fewer than 8, several rows go side by side. A column of x is loaded and blended vertically when the walk
// first needs it, and the last four are kept: loads cost more than anything else. So it is not for maps that shrink to less than a
// quarter. QUAD needs c to be a multiple of 4, WIDE of 8.
#import resize_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> code: array<Stored>;
@group(0) @binding(3) var<storage, read_write> y: array<Stored>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let strips = (p.wo + ${STRIP-1}u) / ${STRIP}u;
    let rows = p.frame_pixels / p.wo;
    let tile = lib_fold(group, groups);
    // Rows of all frames in order.
    let line_of_tiles = tile / strips;
    let line = line_of_tiles * (8u / p.lanes) + local.x / p.lanes;
    if (line * p.wo >= p.pixels) {
        return;
    }
    let frame = line / rows;
    let start = (tile - line_of_tiles * strips) * ${STRIP}u;
    let count = min(${STRIP}u, p.wo - start);
    let v = lib_coordinate(p.oy0 + line - frame * rows, p.y_a, p.y_b, p.y_d);
    let wy = lib_cubic(v.fraction);
    let pitch = p.wi * p.c;
#for j in 0..4
    let row$j = p.x_rest + (frame * p.hi + u32(clamp(v.cell + ${j-1}, 0, i32(p.hi) - 1)) - p.iy0) * pitch;
#end
    let last = i32(p.wi) - 1;
    // The horizontal coordinate of lib_coordinate, from pixel to pixel without a division.
    let n0 = start * p.x_a + p.x_b;
    let whole = p.x_a / p.x_d;
    let part = p.x_a - whole * p.x_d;
    for (var c = local.x % p.lanes; c < p.c; c += max(p.lanes, 1u)) {
        var cell = i32(n0 / p.x_d) - 1;
        var over = n0 % p.x_d;
        var to = p.y_rest + (line * p.wo + start) * p.c + c;
        // The columns around a cell, of which the last is there: none yet.
        var there = cell - 2;
        var a = Value();
        var b = Value();
        var d = Value();
        var e = Value();
        for (var o = 0u; o < count; o++) {
            for (var i = there + 1; i <= cell + 2; i++) {
                a = b;
                b = d;
                d = e;
                let at = u32(clamp(i, 0, last)) * p.c + c;
                e = lib_value(x[row0 + at]) * wy.x + lib_value(x[row1 + at]) * wy.y + lib_value(x[row2 + at]) * wy.z
                    + lib_value(x[row3 + at]) * wy.w;
            }
            there = max(there, cell + 2);
            let wx = lib_cubic(f32(over) / f32(p.x_d));
            y[to] = lib_stored(a * wx.x + b * wx.y + d * wx.z + e * wx.w);
            to += p.c;
            cell += i32(whole);
            over += part;
            if (over >= p.x_d) {
                over -= p.x_d;
                cell += 1;
            }
        }
    }
}
