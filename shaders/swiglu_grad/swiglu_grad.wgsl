// swiglu_grad: the gradient of y[m, j] = silu(a) b, where a = x[m, j] and b = x[m, h + j]:
//
//   dx[m, j] = dy[m, j] b silu'(a),  dx[m, h + j] = dy[m, j] silu(a)
//   silu(a) = a s, silu'(a) = s (1 + a (1 - s)), s = 1 / (1 + exp(-a))
//
// x and dx [m, 2h], dy [m, h]. An invocation owns $STEPS elements of dy (see lib/value), $LANES apart. Where it owns
// several, a row has at least $LANES.
#import grid
#import value

struct Params {
    // Elements of dy in this dispatch, and in a row.
    n: u32,
    h: u32,
    // Distance of the first element from the start of the windows of x (and dx) and dy.
    x_rest: u32,
    dy_rest: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> dy: array<Stored>;
@group(0) @binding(3) var<storage, read_write> dx: array<Stored>;

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
        let a = lib_value(x[at]);
        let b = lib_value(x[at + p.h]);
        let g = lib_value(dy[p.dy_rest + i]);
        let s = 1.0 / (1.0 + exp(-a));
        // 1 - s without cancellation; beyond 80 silu is 0 or the identity in f32.
        let bounded = clamp(a, Value(-80.0), Value(80.0));
        let others = 1.0 / (1.0 + exp(bounded));
        dx[at] = lib_stored(g * b * (s * (1.0 + bounded * others)));
        dx[at + p.h] = lib_stored(g * (a * s));
    }
}
