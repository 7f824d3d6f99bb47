// What `deform_sample` and `trajectory` share: parameters, and where a pixel samples the field.
//
// Pixel (px, py) of a width x height image, level l, point q samples at the cell coordinates
//   x = clamp(px / (width - 1) + offset.x / wp, 0, 1) wp - 1/2,  y alike with height and hp:
// cell centres at whole numbers; bilinear, cells outside count as zero. Points go in the order (level, point), the four
// cells of a point row by row, each one fma: the one order of summation everywhere.
// offsets [n, levels, points, 2] and weights [n, levels, points] have one row a listed pixel.

const LISTED: u32 = 1u;
const RELATIVE: u32 = 2u;

struct Params {
    // Pixels of this dispatch, and the place of the first in the list.
    n: u32,
    first: u32,
    width: u32,
    height: u32,
    hp: u32,
    wp: u32,
    levels: u32,
    points: u32,
    // Times of the field, times of this dispatch, and how many of the range come before them.
    times: u32,
    nt: u32,
    skip: u32,
    flags: u32,
    // Distances of the first word from the start of the windows.
    o_rest: u32,
    w_rest: u32,
    i_rest: u32,
    y_rest: u32,
    x_rest: u32,
    theta_rest: u32,
    // Words of the result from one time to the next.
    step: u32,
    gate: u32,
    threshold: f32,
    min_norm: f32,
    // vec4 of one time of one level of the packed field, and of one level (trajectory, the variants that pack).
    slot: u32,
    level: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// The pixel's place in 0..1 from the first to the last row or column, times 1; a lone row or column is at 0.
fn lib_reference(pixel: u32) -> vec2<f32> {
    let row = pixel / p.width;
    let at = vec2<f32>(f32(pixel - row * p.width), f32(row));
    return at / vec2<f32>(f32(max(p.width, 2u) - 1u), f32(max(p.height, 2u) - 1u));
}

// The four cells of a sampling point and their weights; cells outside have weight 0 and a neighbour's index.
struct LibTaps {
    cell: vec4<u32>,
    weight: vec4<f32>,
}

fn lib_taps(reference: vec2<f32>, offset: vec2<f32>, weight: f32) -> LibTaps {
    let grid = vec2<f32>(f32(p.wp), f32(p.hp));
    let at = clamp(reference + offset / grid, vec2<f32>(0.0), vec2<f32>(1.0)) * grid - vec2<f32>(0.5);
    let low = floor(at);
    let fraction = at - low;
    let last = vec2<i32>(i32(p.wp), i32(p.hp)) - vec2<i32>(1);
    // The clamp before the arithmetic keeps what is not a number on the grid.
    let a = clamp(vec2<i32>(low), vec2<i32>(-1), last);
    let b = a + vec2<i32>(1);
    let wa = select(vec2<f32>(0.0), vec2<f32>(1.0) - fraction, a >= vec2<i32>(0));
    let wb = select(vec2<f32>(0.0), fraction, b <= last);
    let ca = vec2<u32>(max(a, vec2<i32>(0)));
    let cb = vec2<u32>(min(b, last));
    let rows = vec2<u32>(ca.y, cb.y) * p.wp;
    return LibTaps(
        vec4<u32>(rows.x + ca.x, rows.x + cb.x, rows.y + ca.x, rows.y + cb.x),
        vec4<f32>(wa.y * wa.x, wa.y * wb.x, wb.y * wa.x, wb.y * wb.x) * weight);
}
