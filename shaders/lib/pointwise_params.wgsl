// What all forms of `pointwise` share: parameters, the place of b and the plain operations.
//
//   y[i] = op(a[i], b[(i / b_div) % b_len]), a and y [n]; plain unary operations have no b.
//
// Texts with TWO read two numbers always and take their operation from lib/pointwise_more or lib/pointwise_gradient, or choose
// between a and a third number c [n] (SELECT).
//
// The operation is a number, so that all of them share one pipeline (on software devices all but the costly ones); s and t are constants of some. b is either taken as
// a is (b4: same shape as a, or a row over rows of a) or one number for several of a (b1: one number per row of a, or one at all).
#import activation

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
    // Steps of four elements (on software devices eight) that an invocation owns.
    steps: u32,
    pad0: u32,
}

// b_mode: 0 no b, 1 as a, 2 any place, 3 any place that the elements of a step share.
const B_SAME: u32 = 1u;
const B_SHARED: u32 = 3u;

@group(0) @binding(0) var<uniform> p: Params;

// Where element i of this dispatch finds its b, as (i / b_div % b_len, i % b_div).
fn place(i: u32) -> vec2<u32> {
    let at = p.first + i;
    let whole = at / p.b_div;
    return vec2<u32>(whole % p.b_len, at - whole * p.b_div);
}

// The place a step on, without a division: they cost more than anything else here.
fn next(at: vec2<u32>, step: vec2<u32>) -> vec2<u32> {
    let r = at.y + step.y;
    let carry = r >= p.b_div;
    let q = at.x + step.x + select(0u, 1u, carry);
    return vec2<u32>(select(q, q - p.b_len, q >= p.b_len), select(r, r - p.b_div, carry));
}

#if TWO
// Where a mask is not 0, by its bits: NaN is not, whatever a compiler takes for granted about numbers.
fn nonzero(w: vec4<f32>) -> vec4<bool> {
    return (bitcast<vec4<u32>>(w) & vec4<u32>(0x7fffffffu)) != vec4<u32>(0u);
}
#endif

#if !TWO
// Plain operations by number: of two numbers, cheap ones of one (`simple`), and costly ones.
const UNARY: u32 = 6u;
const COSTLY: u32 = 13u;

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
        case 3u: { return max(v, w); }
        case 4u: { return min(v, w); }
        default: { return v / w; }
    }
}

fn simple(op: u32, s: f32, t: f32, v: vec4<f32>) -> vec4<f32> {
    switch op {
        case 6u: { return max(v, vec4<f32>(0.0)); }
        case 7u: { return -v; }
        case 8u: { return abs(v); }
        case 9u: { return v * v; }
        case 10u: { return v * s + t; }
        case 11u: { return clamp(v, vec4<f32>(s), vec4<f32>(t)); }
        default: { return select(vec4<f32>(0.0), vec4<f32>(1.0), v < vec4<f32>(s)); }
    }
}

fn costly(op: u32, s: f32, t: f32, v: vec4<f32>) -> vec4<f32> {
    switch op {
        case 13u: { return 1.0 / v; }
        case 14u: { return sqrt(v); }
        case 15u: { return lib_activate(v, ACT_GELU); }
        case 16u: { return lib_activate(v, ACT_SILU); }
        case 17u: { return sigmoid(v); }
        case 18u: { return softplus(v); }
        case 19u: { return exp(v); }
        case 20u: { return log(v); }
        case 21u: { return exp(clamp(v, vec4<f32>(s), vec4<f32>(t))); }
        default: { return tanh(clamp(v, vec4<f32>(-20.0), vec4<f32>(20.0))); }
    }
}
#endif
