// A sampling point's place between its four cells, for gradients; see lib/deform_params for the equations.
#import deform_params

struct LibPlace {
    // Row by row, a cell outside with a neighbour's index and 0 inside.
    cell: vec4<u32>,
    inside: vec4<f32>,
    // From the first column and row to the point.
    fraction: vec2<f32>,
    // By coordinate 1 where the position is not clamped, so that it follows the offset: a cell for a cell.
    follows: vec2<f32>,
}

fn lib_place(reference: vec2<f32>, offset: vec2<f32>) -> LibPlace {
    let grid = vec2<f32>(f32(p.wp), f32(p.hp));
    let wanted = reference + offset / grid;
    let free = (wanted >= vec2<f32>(0.0)) & (wanted <= vec2<f32>(1.0));
    let at = clamp(wanted, vec2<f32>(0.0), vec2<f32>(1.0)) * grid - vec2<f32>(0.5);
    let low = floor(at);
    let last = vec2<i32>(i32(p.wp), i32(p.hp)) - vec2<i32>(1);
    // The clamp before the arithmetic keeps what is not a number on the grid.
    let a = clamp(vec2<i32>(low), vec2<i32>(-1), last);
    let b = a + vec2<i32>(1);
    let has_a = select(vec2<f32>(0.0), vec2<f32>(1.0), a >= vec2<i32>(0));
    let has_b = select(vec2<f32>(0.0), vec2<f32>(1.0), b <= last);
    let ca = vec2<u32>(max(a, vec2<i32>(0)));
    let cb = vec2<u32>(min(b, last));
    let rows = vec2<u32>(ca.y, cb.y) * p.wp;
    return LibPlace(
        vec4<u32>(rows.x + ca.x, rows.x + cb.x, rows.y + ca.x, rows.y + cb.x),
        vec4<f32>(has_a.y * has_a.x, has_a.y * has_b.x, has_b.y * has_a.x, has_b.y * has_b.x),
        at - low,
        select(vec2<f32>(0.0), vec2<f32>(1.0), free));
}
