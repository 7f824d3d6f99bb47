// The operations of `pointwise` that losses add, by number: comparisons as 1 and 0, masks, sign, finite or not, powers. Those of one
// number get it twice. All but the power are cheap: CHEAP leaves it out, since software devices execute every branch.

#if !CHEAP
#import power

// v to the power s, for a negative v by the parity of s; NaN where s is no integer.
fn power(v: vec4<f32>, s: f32) -> vec4<f32> {
    let size = lib_power(abs(v), s);
    let odd = abs(s - 2.0 * floor(0.5 * s)) == 1.0;
    let whole = floor(s) == s;
    // The root of a negative number, which is NaN on every device.
    let negative = select(sqrt(v), select(size, -size, odd), whole);
    return select(size, negative, v < vec4<f32>(0.0));
}
#endif

fn two(op: u32, s: f32, t: f32, v: vec4<f32>, w: vec4<f32>) -> vec4<f32> {
    let zero = vec4<f32>(0.0);
    let one = vec4<f32>(1.0);
    switch op {
        case 0u: { return select(zero, one, v == w); }
        case 1u: { return select(zero, one, v < w); }
        case 2u: { return select(zero, v, nonzero(w)); }
        case 3u: { return select(v, zero, nonzero(w)); }
        case 4u: { return select(zero, one, v > zero) - select(zero, one, v < zero); }
#if !CHEAP
        case 6u: { return power(v, s); }
#endif
        // Finite or not, by bits: compilers may take it that no number is NaN or infinite.
        default: {
            let size = bitcast<vec4<u32>>(v) & vec4<u32>(0x7fffffffu);
            return select(zero, one, size < vec4<u32>(0x7f800000u));
        }
    }
}
