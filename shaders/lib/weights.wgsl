// Packed weights of `linear` and the convolutions: blocks of 32 output columns, W[block][k][32], so that
// the 8 vec4 of one k lie side by side. f16 storage (W16) keeps two k in one vec4<u32>:
// component c = (w[k][c], w[k+1][c]). The host packs with `PackedWeights`. A device without f16 reads both.

#if W16
fn lib_even(u: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(unpack2x16float(u.x).x, unpack2x16float(u.y).x, unpack2x16float(u.z).x, unpack2x16float(u.w).x);
}
fn lib_odd(u: vec4<u32>) -> vec4<f32> {
    return vec4<f32>(unpack2x16float(u.x).y, unpack2x16float(u.y).y, unpack2x16float(u.z).y, unpack2x16float(u.w).y);
}
#endif
