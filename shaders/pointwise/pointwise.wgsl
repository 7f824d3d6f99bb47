// pointwise: y[i] = op(a[i], b[(i / b_div) % b_len]), a and y [n]; unary operations have no b.
//
// The operation is a number, so that all of them share one pipeline; s and t are constants of some.
// b is either taken four at a time (b4: same shape as a, or a row over rows of a) or one number for all
// four of a (b1: one number a row of a, or one at all). Variant VEC4: n, b_div, b_len and all offsets are
// multiples of 4, or b is taken one by one and b_div is.
//
// An invocation owns `steps` times four elements, 4 $LANES apart. With QUAD a workgroup is one subgroup of 8 lanes: a software
// rasteriser finishes the loop of one subgroup before it starts the next, so only then are the addresses it walks consecutive.
#import activation
#import value
#import grid

struct Params {
    // Elements of this dispatch.
    n: u32,
    op: u32,
    b_mode: u32,
    b_div: u32,
    b_len: u32,
    // Index of this dispatch's first element in the whole tensor, and of b's first bound element in all of b.
    first: u32,
    b_first: u32,
    // Distance of the first element from the start of the window of a and y.
    rest: u32,
    s: f32,
    t: f32,
    // Times four elements an invocation owns.
    steps: u32,
    pad0: u32,
}

// b_mode: 0 no b, 1 as a, 2 any place, 3 any place that four neighbours share.
const B_SAME: u32 = 1u;
const B_PER_FOUR: u32 = 3u;

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> a: array<Stored>;
@group(0) @binding(2) var<storage, read> b4: array<Stored>;
@group(0) @binding(3) var<storage, read> b1: array<f32>;
@group(0) @binding(4) var<storage, read_write> y: array<Stored>;

// Where element i of this dispatch finds its b, as (i / b_div % b_len, i % b_div).
fn place(i: u32) -> vec2<u32> {
    let at = p.first + i;
    let whole = at / p.b_div;
    return vec2<u32>(whole % p.b_len, at - whole * p.b_div);
}

// The place 4 $LANES elements on, without a division: they cost more than anything else here.
fn next(at: vec2<u32>, step: vec2<u32>) -> vec2<u32> {
    let r = at.y + step.y;
    let carry = r >= p.b_div;
    let q = at.x + step.x + select(0u, 1u, carry);
    return vec2<u32>(select(q, q - p.b_len, q >= p.b_len), select(r, r - p.b_div, carry));
}

// b of the four elements from i on, whose place is `at`.
fn b_at(i: u32, at: vec2<u32>) -> vec4<f32> {
#if VEC4
    if (p.b_mode == B_PER_FOUR) {
        return vec4<f32>(b1[at.x - p.b_first]);
    }
    let same = p.b_mode == B_SAME;
    return lib_value(b4[(select(at.x, p.first + i, same) - p.b_first) / 4u]);
#else
    if (p.b_mode == B_SAME) {
        let same = p.first + i - p.b_first;
        return vec4<f32>(b4[same], b4[same + 1u], b4[same + 2u], b4[same + 3u]);
    }
    return vec4<f32>(b1[at.x - p.b_first], b1[place(i + 1u).x - p.b_first], b1[place(i + 2u).x - p.b_first],
        b1[place(i + 3u).x - p.b_first]);
#endif
}

// NaN passes through.
fn softplus(v: vec4<f32>) -> vec4<f32> {
    // log(1 + e^v) without overflow or cancellation: max(v, 0) + log(1 + e^-|v|).
    let e = exp(-abs(v));
    // log1p for small e by its series: log(1 + e) would lose e's low bits.
    let series = e * (1.0 - e * (0.5 - e * (0.33333333 - e * 0.25)));
    return select(max(v, vec4<f32>(0.0)) + select(log(1.0 + e), series, e < vec4<f32>(0.01)), v, v > vec4<f32>(20.0));
}

fn sigmoid(v: vec4<f32>) -> vec4<f32> {
    return 1.0 / (1.0 + exp(-v));
}

fn binary(op: u32, v: vec4<f32>, w: vec4<f32>) -> vec4<f32> {
    switch op {
        case 0u: { return v + w; }
        case 1u: { return v - w; }
        case 2u: { return v * w; }
        case 3u: { return v / w; }
        case 4u: { return max(v, w); }
        default: { return min(v, w); }
    }
}

fn simple(op: u32, v: vec4<f32>) -> vec4<f32> {
    switch op {
        case 6u: { return max(v, vec4<f32>(0.0)); }
        case 7u: { return -v; }
        case 8u: { return abs(v); }
        case 9u: { return v * v; }
        case 10u: { return 1.0 / v; }
        case 11u: { return v * p.s + p.t; }
        case 12u: { return clamp(v, vec4<f32>(p.s), vec4<f32>(p.t)); }
        case 13u: { return sqrt(v); }
        default: { return select(vec4<f32>(0.0), vec4<f32>(1.0), v < vec4<f32>(p.s)); }
    }
}

fn transcendental(op: u32, v: vec4<f32>) -> vec4<f32> {
    switch op {
        case 16u: { return lib_activate(v, ACT_GELU); }
        case 17u: { return lib_activate(v, ACT_SILU); }
        case 18u: { return sigmoid(v); }
        case 19u: { return softplus(v); }
        case 20u: { return exp(v); }
        case 21u: { return log(v); }
        case 22u: { return exp(clamp(v, vec4<f32>(p.s), vec4<f32>(p.t))); }
        default: { return tanh(clamp(v, vec4<f32>(-20.0), vec4<f32>(20.0))); }
    }
}

// Four elements from i on.
fn load(i: u32) -> vec4<f32> {
#if VEC4
    return lib_value(a[(p.rest + i) / 4u]);
#else
    let at = p.rest + i;
    return vec4<f32>(a[at], a[at + 1u], a[at + 2u], a[at + 3u]);
#endif
}

fn store(i: u32, v: vec4<f32>) {
#if VEC4
    y[(p.rest + i) / 4u] = lib_stored(v);
#else
    for (var k = 0u; k < min(4u, p.n - i); k++) {
        y[p.rest + i + k] = v[k];
    }
#endif
}

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // The operation is chosen outside of the loop.
    let first = lib_fold(group, groups) * ${4*LANES}u * p.steps + local.x * 4u;
    let end = min(p.n, first + ${4*LANES}u * p.steps);
    if (p.op < 6u) {
        var at = place(first);
        let step = vec2<u32>(${4*LANES}u / p.b_div % p.b_len, ${4*LANES}u % p.b_div);
        for (var i = first; i < end; i += ${4*LANES}u) {
            store(i, binary(p.op, load(i), b_at(i, at)));
            at = next(at, step);
        }
    } else if (p.op < 16u) {
        for (var i = first; i < end; i += ${4*LANES}u) {
            store(i, simple(p.op, load(i)));
        }
    } else {
        for (var i = first; i < end; i += ${4*LANES}u) {
            store(i, transcendental(p.op, load(i)));
        }
    }
}
