// What a convolution adds, by the bits of `flags`; the host's `Conv2d::flags` has the same.
const HAS_BIAS: u32 = 1u;
const HAS_RESIDUAL: u32 = 2u;
const HAS_RESIDUAL2: u32 = 4u;
