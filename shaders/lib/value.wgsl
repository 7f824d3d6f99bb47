// What kernels over large tensors compute with (Value) and how a buffer holds it (Stored): a number, with VEC4 four of them,
// and with QUAD four as the two 64-bit words of lib/quad, which cost a software rasteriser half as much, with WIDE two times four,
// with PAIR two as one word.
#if WIDE
#import quad
alias Value = mat2x4<f32>;
alias Stored = Wide;

fn lib_value(w: Stored) -> Value {
    return lib_wide(w);
}

fn lib_stored(v: Value) -> Stored {
    return lib_to_wide(v[0], v[1]);
}
#else
#if QUAD
#import quad
alias Value = vec4<f32>;
alias Stored = Quad;

fn lib_value(q: Stored) -> Value {
    return lib_quad(q);
}

fn lib_stored(v: Value) -> Stored {
    return lib_to_quad(v);
}
#else
#if PAIR
alias Value = vec2<f32>;
alias Stored = u64;

fn lib_value(w: Stored) -> Value {
    return bitcast<vec2<f32>>(vec2<u32>(u32(w), u32(w >> 32u)));
}

fn lib_stored(v: Value) -> Stored {
    let bits = bitcast<vec2<u32>>(v);
    return u64(bits.x) | (u64(bits.y) << 32u);
}
#else
#if VEC4
alias Value = vec4<f32>;
#else
alias Value = f32;
#endif
alias Stored = Value;

fn lib_value(v: Stored) -> Value {
    return v;
}

fn lib_stored(v: Value) -> Stored {
    return v;
}
#endif
#endif
#endif
