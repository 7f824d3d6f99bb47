// blend: y = shares[0] y + shares[1] x, in place: sums of gradients over samples (1, 1), averages of weights over steps (d, 1 - d).
// Where a share is 0 what it would multiply leaves no trace, even NaN.
//
// Memory bound: 12 bytes a number. An invocation owns $STEPS elements (see lib/value), $LANES apart.
#import grid
#import value

struct Params {
    // Elements of this dispatch.
    n: u32,
    // Distance of the first element from the start of the windows.
    rest: u32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> shares: array<f32>;
@group(0) @binding(3) var<storage, read_write> y: array<Stored>;

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let q = p;
    let keep = shares[0];
    let share = shares[1];
    let first = lib_fold(group, groups) * ${LANES*STEPS}u + local.x;
    let end = min(q.n, first + ${LANES*STEPS}u);
    for (var i = first; i < end; i += ${LANES}u) {
        let at = q.rest + i;
        let before = select(Value() + 0.0, lib_value(y[at]) * keep, keep != 0.0);
        y[at] = lib_stored(before + select(Value() + 0.0, lib_value(x[at]) * share, share != 0.0));
    }
}
