// Gradients of the operations of `pointwise` on one number, by the operation's number: w times the derivative at v, where v went into
// the operation and w is the gradient of what came out.
//
// At a corner: relu and |v| have the derivative 0 at 0, a clamp 1 at its bounds. Where a derivative is 0 because the function is
// flat there, the result is 0 even if w is NaN or infinite. CHEAP leaves the costly ones out, since software devices execute every
// branch.
#import activation

#if !CHEAP
#import power

// Beyond these bounds the derivatives of gelu and silu are 0 or 1 in f32.
fn bounded(v: vec4<f32>, bound: f32) -> vec4<f32> {
    return clamp(v, vec4<f32>(-bound), vec4<f32>(bound));
}

fn logistic(v: vec4<f32>) -> vec4<f32> {
    return 1.0 / (1.0 + exp(-v));
}

// e^-|v| / (1 + e^-|v|)^2: the derivative of the logistic function without cancellation.
fn bell(v: vec4<f32>) -> vec4<f32> {
    let e = exp(-abs(v));
    return e / ((1.0 + e) * (1.0 + e));
}

// Phi(v) + v phi(v).
fn gelu_slope(v: vec4<f32>) -> vec4<f32> {
    let x = bounded(v, 15.0);
    return 0.5 * (1.0 + lib_erf(x * 0.7071067811865476)) + x * exp(-0.5 * x * x) * 0.3989422804014327;
}

fn silu_slope(v: vec4<f32>) -> vec4<f32> {
    let x = bounded(v, 80.0);
    let s = logistic(x);
    return s * (1.0 + x * logistic(-x));
}

// s v^(s - 1); for a negative v by the parity of s - 1, NaN where s is no integer.
fn power_slope(v: vec4<f32>, s: f32) -> vec4<f32> {
    let size = s * lib_power(abs(v), s - 1.0);
    let odd = abs(s - 2.0 * floor(0.5 * s)) == 1.0;
    let whole = floor(s) == s;
    let negative = select(sqrt(v), select(-size, size, odd), whole);
    let slope = select(size, negative, v < vec4<f32>(0.0));
    return select(slope, vec4<f32>(0.0), s == 0.0);
}
#endif

fn two(op: u32, s: f32, t: f32, v: vec4<f32>, w: vec4<f32>) -> vec4<f32> {
    let zero = vec4<f32>(0.0);
    let inside = (v >= vec4<f32>(s)) & (v <= vec4<f32>(t));
    switch op {
        case 6u: { return select(zero, w, v > zero); }
        case 7u: { return -w; }
        case 8u: { return select(zero, w, v > zero) - select(zero, w, v < zero); }
        case 9u: { return 2.0 * v * w; }
        case 10u: { return w * s; }
        case 11u: { return select(zero, w, inside); }
#if !CHEAP
        case 13u: { return -w / (v * v); }
        case 14u: { return 0.5 * w / sqrt(v); }
        case 15u: { return w * gelu_slope(v); }
        case 16u: { return w * silu_slope(v); }
        case 17u: { return w * bell(v); }
        // Beyond 20 the function is the identity, and the logistic function is 1 in f32.
        case 18u: { return w * logistic(v); }
        case 19u: { return w * exp(v); }
        case 20u: { return w / v; }
        case 21u: { return select(zero, w * exp(v), inside); }
        case 22u: { return w * 4.0 * bell(2.0 * v); }
        case 23u: { return w * power_slope(v, s); }
#endif
        // Steps: 1 below a limit, the sign, finite or not.
        default: { return zero; }
    }
}
