// fill: y[i] = value, any pattern of 32 bits, for the n items of a window (see lib/item).
//
// An invocation owns $STEPS items, $LANES apart.
#import grid
#import item

struct Params {
    // Items of this dispatch.
    n: u32,
    value: u32,
    // Distance of the first item from the start of the window.
    y_rest: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read_write> y: array<Item>;

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let first = lib_fold(group, groups) * ${LANES*STEPS}u + local.x;
    let end = min(p.n, first + ${LANES*STEPS}u);
    let value = p.value;
    let rest = p.y_rest;
    for (var i = first; i < end; i += ${LANES}u) {
#if QUAD
        y[rest + i] = vec2<u64>(u64(value) | (u64(value) << 32u));
#else
        y[rest + i] = Item(value);
#endif
    }
}
