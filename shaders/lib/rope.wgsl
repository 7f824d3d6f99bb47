// RoPE, the rotary position code, over two axes.
//
// A head of D channels has two halves: channels 0..D/2 turn with the row of a token, D/2..D with its column.
// Within a half, channel j (0 <= j < D/4) pairs with channel j + D/4, and with the angle t of that pair
//   out[j]       = x[j] cos t - x[j + D/4] sin t
//   out[j + D/4] = x[j + D/4] cos t + x[j] sin t
// A table row has the cosines of the D/2 angles (row half first), then their sines: D numbers.

// Index of the angle of channel d in a table row; the sine is D/2 further on.
fn lib_rope_angle(d: u32, head_dim: u32) -> u32 {
    let half = head_dim / 2u;
    let quarter = head_dim / 4u;
    return d / half * quarter + d % half % quarter;
}

// Whether channel d is the first of its pair.
fn lib_rope_first(d: u32, head_dim: u32) -> bool {
    return d % (head_dim / 2u) < head_dim / 4u;
}

// Channel d turned: x is its value, other that of its partner, both before the turn.
fn lib_rope_turn(x: f32, other: f32, cosine: f32, sine: f32, first: bool) -> f32 {
    return x * cosine + select(other, -other, first) * sine;
}

// Four first channels of pairs, and their partners.
struct LibRopePair {
    first: vec4<f32>,
    second: vec4<f32>,
}

fn lib_rope_turn4(a: vec4<f32>, b: vec4<f32>, cosine: vec4<f32>, sine: vec4<f32>) -> LibRopePair {
    return LibRopePair(a * cosine - b * sine, b * cosine + a * sine);
}
