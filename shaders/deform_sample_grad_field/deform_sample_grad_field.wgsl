// deform_sample_grad_field: what deform_sample's gradient adds to field and mask, any WebGPU device.
//
//   dfield[l, t, cell, c] = sum_i sum_q weights[i, l, q] b(i, l, q, cell) dtau[i, 9 t + c]
//   dmask[cell] = sum_i sum_{l, q} weights[i, l, q] b(i, l, q, cell) dtau[i, 9 T]
//
// with b the bilinear weight of a cell (lib/deform_params). Which pixels reach a cell is not known, so this scatters, without
// atomics and in one order: the pixels are cut into parts, each part has for each level a copy [cells, 9 T + 1] of its own, and
// an invocation owns $COLUMNS columns of one copy. It walks the part's pixels in order and adds to the cells of each point, row by
// row. Neighbouring invocations walk the same points and own neighbouring columns, so that they read and write neighbours.
// sum.wgsl adds the copies.
//
// dtau [n, 9 T + 1], copies [parts, levels, cells, 9 T + 1 rounded up to fours]. A dispatch owns the same piece of each of its
// parts; the first piece clears the copies. What comes behind the last column is never read.
#import deform_params
#import grid
#import value

// Whether what is added to is not yet there.
const CLEAR: u32 = 4u;

@group(0) @binding(1) var<storage, read> offsets: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> pixels: array<u32>;
@group(0) @binding(4) var<storage, read> dtau: array<f32>;
@group(0) @binding(5) var<storage, read_write> copies: array<Stored>;

// The gradients of the columns from `column` on, of a pixel whose row begins at `row`.
fn gradient(row: u32, column: u32) -> Value {
#if QUAD
    let at = row + column * 4u;
    return vec4<f32>(dtau[at], dtau[at + 1u], dtau[at + 2u], dtau[at + 3u]);
#else
    return dtau[row + column];
#endif
}

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let row = p.times * 9u + 1u;
    // Elements of a cell's row of a copy, and those that hold columns (see lib/value).
    let width = (row + 3u) / 4u * ${4/COLUMNS}u;
    let columns = (row + ${COLUMNS-1}u) / ${COLUMNS}u;
    let blocks = (columns + ${LANES-1}u) / ${LANES}u;
    let place = lib_fold(group, groups);
    let slot = place / blocks;
    let column = (place - slot * blocks) * ${LANES}u + local.x;
    // nt: slots of this dispatch; skip: levels of a part that come before its first slot.
    if (slot >= p.nt || column >= columns) {
        return;
    }
    let part = (p.skip + slot) / p.levels;
    let level = p.skip + slot - part * p.levels;
    let cells = p.hp * p.wp;
    let copy = p.x_rest + slot * cells * width + column;
    if ((p.flags & CLEAR) != 0u) {
        for (var cell = 0u; cell < cells; cell++) {
            copies[copy + cell * width] = lib_stored(Value());
        }
    }
    // step: pixels from part to part; n: of this dispatch in each; theta_rest: pixels from its first to the last of all.
    let start = part * p.step;
    let end = min(start + p.n, p.theta_rest);
    let taps = p.levels * p.points;
    for (var i = start; i < end; i++) {
        var pixel = p.first + i;
        if ((p.flags & LISTED) != 0u) {
            pixel = pixels[p.i_rest + i];
        }
        let reference = lib_reference(pixel);
        let g = gradient(p.y_rest + i * row, column);
        for (var j = 0u; j < p.points; j++) {
            let tap = i * taps + level * p.points + j;
            let o = p.o_rest + tap * 2u;
            let at = lib_taps(reference, vec2<f32>(offsets[o], offsets[o + 1u]), weights[p.w_rest + tap]);
#for c in 0..4
            {
                let to = copy + at.cell[$c] * width;
                copies[to] = lib_stored(fma(Value(at.weight[$c]), g, lib_value(copies[to])));
            }
#end
        }
    }
}
