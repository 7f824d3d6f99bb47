// resize_grad, any WebGPU device: the gradient of `resize` (lib/resize_params has the forward pass).
//
//   dx[f, iy, ix, c] = sum_{oy} wy(oy, iy) sum_{ox} wx(ox, ix) dy[f, oy, ox, c]
//
// over the outputs that read the pixel, in order; w(o, i) is the weight with which output o reads cell i of an axis, the sum of
// those of all its taps that lie on the cell (at a border those outside of the map too). An invocation owns one element of dx
// (lib/value: four channels).
//
// The cell below output o is (o a + b) / d - 1, rounded down, and grows with o: the outputs that read cell i are a range, found
// without a search. From output to output the coordinate moves on by a whole and a rest, without a division.
#import grid
#import value

struct Params {
    // Input pixels of this dispatch, in one frame of it, and sizes.
    pixels: u32,
    frame_pixels: u32,
    hi: u32,
    wi: u32,
    ho: u32,
    wo: u32,
    // Channels, in the unit of the variant.
    c: u32,
    y_a: u32,
    y_b: u32,
    y_d: u32,
    x_a: u32,
    x_b: u32,
    x_d: u32,
    // First input row of this dispatch, and first output row of its window of dy.
    iy0: u32,
    oy0: u32,
    // Distance of the first pixel from the start of its window, in the unit of the variant.
    dx_rest: u32,
    dy_rest: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> dy: array<Stored>;
@group(0) @binding(2) var<storage, read_write> dx: array<Stored>;

// The outputs whose cell is at least t - 1, from the first on.
fn reach(t: u32, a: u32, b: u32, d: u32, outputs: u32) -> u32 {
    if (t * d <= b) {
        return 0u;
    }
    if (a == 0u) {
        return outputs;
    }
    return min((t * d - b + a - 1u) / a, outputs);
}

// The outputs that read cell i of an axis of n cells: the first, and one past the last.
fn readers(i: u32, n: u32, a: u32, b: u32, d: u32, outputs: u32) -> vec2<u32> {
    var first = 0u;
    if (i > 0u && i + 1u > ${AFTER}u) {
        first = reach(i + 1u - ${AFTER}u, a, b, d, outputs);
    }
    var end = outputs;
    if (i + 1u < n) {
        end = reach(i + ${BEFORE+2}u, a, b, d, outputs);
    }
    return vec2<u32>(first, end);
}

// The weight of cell i of n for an output between `cell` and the next, at `t` of the way.
fn weight(i: i32, n: u32, cell: i32, t: f32) -> f32 {
    let last = i32(n) - 1;
#if CUBIC
    // Keys' weights of the cells -1, 0, 1, 2 around a fraction.
    let s = 1.0 - t;
    let taps = vec4<f32>(
        -0.75 * t * s * s,
        (1.25 * t - 2.25) * t * t + 1.0,
        (1.25 * s - 2.25) * s * s + 1.0,
        -0.75 * s * t * t);
    let at = clamp(vec4<i32>(cell) + vec4<i32>(-1, 0, 1, 2), vec4<i32>(0), vec4<i32>(last));
    let mine = select(vec4<f32>(0.0), taps, at == vec4<i32>(i));
    return (mine.x + mine.y) + (mine.z + mine.w);
#else
    let at = clamp(vec2<i32>(cell) + vec2<i32>(0, 1), vec2<i32>(0), vec2<i32>(last));
    let mine = select(vec2<f32>(0.0), vec2<f32>(1.0 - t, t), at == vec2<i32>(i));
    return mine.x + mine.y;
#endif
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let pixel = index / p.c;
    if (pixel >= p.pixels) {
        return;
    }
    let c = index - pixel * p.c;
    let frame = pixel / p.frame_pixels;
    let inside = pixel - frame * p.frame_pixels;
    let row = inside / p.wi;
    let iy = p.iy0 + row;
    let ix = inside - row * p.wi;
    let rows = readers(iy, p.hi, p.y_a, p.y_b, p.y_d, p.ho);
    let columns = readers(ix, p.wi, p.x_a, p.x_b, p.x_d, p.wo);
    let y_whole = p.y_a / p.y_d;
    let y_part = p.y_a - y_whole * p.y_d;
    let x_whole = p.x_a / p.x_d;
    let x_part = p.x_a - x_whole * p.x_d;
    let y_start = rows.x * p.y_a + p.y_b;
    let x_start = columns.x * p.x_a + p.x_b;
    var y_cell = y_start / p.y_d;
    var y_over = y_start - y_cell * p.y_d;
    let x_first = x_start / p.x_d;
    let x_rest = x_start - x_first * p.x_d;
    var sum = Value();
    for (var oy = rows.x; oy < rows.y; oy++) {
        var line = Value();
        var cell = x_first;
        var over = x_rest;
        var at = p.dy_rest + ((frame * p.ho + oy - p.oy0) * p.wo + columns.x) * p.c + c;
        for (var ox = columns.x; ox < columns.y; ox++) {
            line += lib_value(dy[at]) * weight(i32(ix), p.wi, i32(cell) - 1, f32(over) / f32(p.x_d));
            at += p.c;
            cell += x_whole;
            over += x_part;
            if (over >= p.x_d) {
                over -= p.x_d;
                cell += 1u;
            }
        }
        sum += line * weight(i32(iy), p.hi, i32(y_cell) - 1, f32(y_over) / f32(p.y_d));
        y_cell += y_whole;
        y_over += y_part;
        if (y_over >= p.y_d) {
            y_over -= p.y_d;
            y_cell += 1u;
        }
    }
    dx[p.dx_rest + index] = lib_stored(sum);
}
