// Packed weights (lib/weights) in a storage buffer, read one vec4 of columns at a time.
#import weights

#if W16
@group(0) @binding(2) var<storage, read> w: array<vec4<u32>>;
#else
#if W8
@group(0) @binding(2) var<storage, read> w: array<vec4<u32>>;
#else
@group(0) @binding(2) var<storage, read> w: array<vec4<f32>>;
#endif
#endif

// Columns 4 lane .. 4 lane + 3 of a block at depth k.
fn lib_weight(block: u32, k: u32, lane: u32) -> vec4<f32> {
#if W16
    let u = w[(block * p.k_packed / 2u + k / 2u) * 8u + lane];
    return select(lib_odd(u), lib_even(u), k % 2u == 0u);
#else
#if W8
    return lib_byte(w[(block * p.k_packed / 4u + k / 4u) * 8u + lane], k % 4u);
#else
    return w[(block * p.k_packed + k) * 8u + lane];
#endif
#endif
}

// The same for four k from `k`, a multiple of 4: one vec4 each.
fn lib_weight4(block: u32, k: u32, lane: u32) -> mat4x4<f32> {
#if W16
    let at = (block * p.k_packed / 2u + k / 2u) * 8u + lane;
    let u = w[at];
    let v = w[at + 8u];
    return mat4x4<f32>(lib_even(u), lib_odd(u), lib_even(v), lib_odd(v));
#else
#if W8
    let u = w[(block * p.k_packed / 4u + k / 4u) * 8u + lane];
    return mat4x4<f32>(lib_byte(u, 0u), lib_byte(u, 1u), lib_byte(u, 2u), lib_byte(u, 3u));
#else
    let at = (block * p.k_packed + k) * 8u + lane;
    return mat4x4<f32>(w[at], w[at + 8u], w[at + 16u], w[at + 24u]);
#endif
#endif
}
