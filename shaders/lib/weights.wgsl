// Packed weights of `linear` and the convolutions: blocks of 32 output columns, W[block][k][32], so that
// the 8 vec4 of one k lie side by side. f16 storage (W16) keeps two k in one vec4<u32>:
// component c = (w[k][c], w[k+1][c]). int8 storage (W8) keeps four k in one vec4<u32>, the lowest byte first; a
// column's numbers are its bytes times its scale. The host packs with `PackedWeights`. No device needs a feature.

#if W16
fn lib_even(u: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(unpack2x16float(u.x).x, unpack2x16float(u.y).x, unpack2x16float(u.z).x, unpack2x16float(u.w).x);
}
fn lib_odd(u: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(unpack2x16float(u.x).y, unpack2x16float(u.y).y, unpack2x16float(u.z).y, unpack2x16float(u.w).y);
}
#endif
#if W8
// Byte j of every word as a number. Shifts of whole vectors: unpack4xI8 gives four k of one column, not one k of four.
fn lib_byte(u: vec4<u32>, j: u32) -> vec4<f32> {
    return vec4<f32>(bitcast<vec4<i32>>(u << vec4<u32>(24u - 8u * j)) >> vec4<u32>(24u));
}
#endif
