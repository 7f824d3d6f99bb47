// What kernels move that leave numbers as they are: a 32-bit word, four of them with VEC4, four as two 64-bit words with QUAD
// (which cost a software rasteriser half as much).
#if QUAD
alias Item = vec2<u64>;
#else
#if VEC4
alias Item = vec4<u32>;
#else
alias Item = u32;
#endif
#endif
