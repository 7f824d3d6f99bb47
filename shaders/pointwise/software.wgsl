// pointwise, software devices: see lib/pointwise_params for the equation.
//
// A workgroup is one subgroup of 8 lanes, which a software rasteriser sends through the whole loop before the next one starts:
// only so are the addresses that are walked consecutive. A step is eight elements, four 64-bit words in one load. All
// branches are executed here, under a mask: operations of two numbers and cheap ones of one have a loop each, of which the one that has
// nothing to do ends after one turn, and a costly operation (OP, its number) is a variant. Needs n and all offsets to be
// multiples of 8, and b's length, or what shares an element of b.
#import pointwise_params
#if MORE
#import pointwise_more
#endif
#if GRADIENT
#import pointwise_gradient
#endif
#import grid
#import quad

@group(0) @binding(1) var<storage, read> a: array<Wide>;
@group(0) @binding(2) var<storage, read> b4: array<Wide>;
@group(0) @binding(3) var<storage, read> b1: array<f32>;
@group(0) @binding(4) var<storage, read_write> y: array<Wide>;
#if SELECT
@group(0) @binding(5) var<storage, read> c: array<Wide>;
#endif

// b of the eight elements from i on, whose place is `at`.
fn b_at(i: u32, at: vec2<u32>) -> mat2x4<f32> {
    if (p.b_mode == B_SHARED) {
        let b = vec4<f32>(b1[at.x - p.b_first]);
        return mat2x4<f32>(b, b);
    }
    return lib_wide(b4[(select(at.x, p.first + i, p.b_mode == B_SAME) - p.b_first) / 8u]);
}

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let first = lib_fold(group, groups) * 64u * p.steps + local.x * 8u;
    let end = min(p.n, first + 64u * p.steps);
    let start = (p.rest + first) / 8u;
    // Read once: the driver would read them in every turn.
    let q = p;
#if TWO
#if OP
    let op = ${OP}u;
#else
    let op = q.op;
#endif
    var at = place(first);
    let step = vec2<u32>(64u / p.b_div % p.b_len, 64u % p.b_div);
    var here = start;
    for (var i = first; i < end; i += 64u) {
        let v = lib_wide(a[here]);
        let w = b_at(i, at);
#if SELECT
        let u = lib_wide(c[here]);
        y[here] = lib_to_wide(select(u[0], v[0], nonzero(w[0])), select(u[1], v[1], nonzero(w[1])));
#else
        y[here] = lib_to_wide(two(op, q.s, q.t, v[0], w[0]), two(op, q.s, q.t, v[1], w[1]));
#endif
        at = next(at, step);
        here += 8u;
    }
#else
#if OP
    var here = start;
    for (var i = first; i < end; i += 64u) {
        let v = lib_wide(a[here]);
        y[here] = lib_to_wide(costly(${OP}u, q.s, q.t, v[0]), costly(${OP}u, q.s, q.t, v[1]));
        here += 8u;
    }
#else
    if (p.op < UNARY) {
        var at = place(first);
        let step = vec2<u32>(64u / p.b_div % p.b_len, 64u % p.b_div);
        var here = start;
        for (var i = first; i < end; i += 64u) {
            let v = lib_wide(a[here]);
            let w = b_at(i, at);
            y[here] = lib_to_wide(binary(q.op, v[0], w[0]), binary(q.op, v[1], w[1]));
            at = next(at, step);
            here += 8u;
        }
    }
    if (p.op >= UNARY) {
        var here = start;
        for (var i = first; i < end; i += 64u) {
            let v = lib_wide(a[here]);
            y[here] = lib_to_wide(simple(q.op, q.s, q.t, v[0]), simple(q.op, q.s, q.t, v[1]));
            here += 8u;
        }
    }
#endif
#endif
}
