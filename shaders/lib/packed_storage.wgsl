// Packed weights (lib/weights) in a storage buffer, read one vec4 of columns at a time.
#import weights

#if W16
@group(0) @binding(2) var<storage, read> w: array<vec4<u32>>;
#else
@group(0) @binding(2) var<storage, read> w: array<vec4<f32>>;
#endif

// Columns 4 lane .. 4 lane + 3 of a block at depth k.
fn lib_weight(block: u32, k: u32, lane: u32) -> vec4<f32> {
#if W16
    let u = w[(block * p.k_packed / 2u + k / 2u) * 8u + lane];
    return select(lib_odd(u), lib_even(u), k % 2u == 0u);
#else
    return w[(block * p.k_packed + k) * 8u + lane];
#endif
}
