// swiglu: y[m, j] = silu(x[m, j]) * x[m, h + j], x [m, 2h], y [m, h].
//
// An invocation owns $STEPS elements of y (see lib/value), $LANES apart. Where it owns several, a row has at least $LANES.
#import activation
#import grid
#import value

struct Params {
    // Elements of y in this dispatch, and in a row.
    n: u32,
    h: u32,
    // Distance of the first element from the start of the windows.
    x_rest: u32,
    y_rest: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read_write> y: array<Stored>;

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let first = lib_fold(group, groups) * ${LANES*STEPS}u + local.x;
    let end = min(p.n, first + ${LANES*STEPS}u);
    // Element j of row r of the first half is at 2 r h + j = i + r h: `before` is r h, and the row ends at `edge`.
    var before = first / p.h * p.h;
    var edge = before + p.h;
    for (var i = first; i < end; i += ${LANES}u) {
        let on = select(0u, p.h, i >= edge);
        before += on;
        edge += on;
        let at = p.x_rest + i + before;
#if VEC4
        y[p.y_rest + i] = lib_stored(lib_activate(lib_value(x[at]), ACT_SILU) * lib_value(x[at + p.h]));
#else
        y[p.y_rest + i] = lib_activate(vec4<f32>(x[at]), ACT_SILU).x * x[at + p.h];
#endif
    }
}
