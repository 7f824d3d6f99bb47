// Four floats in a buffer as two 64-bit words: a software rasteriser loads and stores every component of every
// lane by itself, so half as many components are half the work. Kernels over large tensors gain by it only
// where they walk memory in order (benches/log/2026-11-27-memory-bound-kernels.md).
alias Quad = vec2<u64>;

// Two neighbouring Quads in one load or store: address, lane mask and binding are looked up once for both.
alias Wide = vec4<u64>;

fn lib_quad_bits(q: Quad) -> vec4<u32> {
    let low = vec2<u32>(q);
    let high = vec2<u32>(q >> vec2<u32>(32u));
    return vec4<u32>(low.x, high.x, low.y, high.y);
}

fn lib_quad(q: Quad) -> vec4<f32> {
    return bitcast<vec4<f32>>(lib_quad_bits(q));
}

fn lib_to_quad(v: vec4<f32>) -> Quad {
    let bits = bitcast<vec4<u32>>(v);
    return vec2<u64>(bits.xz) | (vec2<u64>(bits.yw) << vec2<u32>(32u));
}

fn lib_wide(w: Wide) -> mat2x4<f32> {
    return mat2x4<f32>(lib_quad(w.xy), lib_quad(w.zw));
}

fn lib_to_wide(a: vec4<f32>, b: vec4<f32>) -> Wide {
    return Wide(lib_to_quad(a), lib_to_quad(b));
}
