// swiglu: y[m, j] = silu(x[m, j]) * x[m, h + j], x [m, 2h], y [m, h].
//
// An invocation owns one element of y; elements are vec4 in the variant VEC4.
#import activation
#import grid

struct Params {
    // Elements of y in this dispatch, and in a row.
    n: u32,
    h: u32,
    // Distance of the first element from the start of the windows.
    x_rest: u32,
    y_rest: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
#if VEC4
@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read_write> y: array<vec4<f32>>;
#else
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<f32>;
#endif

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    if (i >= p.n) {
        return;
    }
    // Element j of row r of the first half is at 2 r h + j = i + r h.
    let at = p.x_rest + i + i / p.h * p.h;
#if VEC4
    y[p.y_rest + i] = lib_activate(x[at], ACT_SILU) * x[at + p.h];
#else
    y[p.y_rest + i] = lib_activate(vec4<f32>(x[at]), ACT_SILU).x * x[at + p.h];
#endif
}
