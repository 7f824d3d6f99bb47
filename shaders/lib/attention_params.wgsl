// What all variants of `attention` share: parameters, flags and indices.
//
//   out[g * nq + i, h * D + d] = sum_j softmax_j(q[g, h, i] . k[g, h, j]) v[g, h, j, d]
//
// q [groups][heads][nq_pad][Dp], already scaled; k [groups][heads][nk_pad / 32][Dp][32], keys transposed in blocks of 32;
// v [groups][heads][nk_pad][Dp]; *_pad are multiples of 32, Dp is D rounded up to 32, all padding zero.
// The softmax is the online one: a running maximum m and sum l a row, and what was summed so far is multiplied by
// exp(m_old - m_new) when the maximum grows. Between windows of keys the unnormalised sums stay in out,
// m and l in state [groups][heads][nq_pad][2], where they stay at the end for gradients; the numbers and their order are those of one long window.

// First window of keys: nothing to take over.
const FIRST: u32 = 1u;
// Last window of keys: divide by l.
const LAST: u32 = 2u;
// Write m and l: more windows follow, or the gradients want them.
const KEEP: u32 = 4u;
// A score that never counts, and the first maximum.
const NEVER: f32 = -1e30;

struct Params {
    heads: u32,
    head_dim: u32,
    // Queries of a group, and with padding.
    nq: u32,
    nq_pad: u32,
    // Keys of a group.
    nk: u32,
    // Keys from one head to the next within the bindings of k and v.
    kv_pad: u32,
    // First (group, head), counted group * heads + head, and how many this dispatch covers.
    head0: u32,
    head_count: u32,
    // First query of this dispatch and how many, both multiples of 32; the query at the start of the bindings of q and state.
    q0: u32,
    q_count: u32,
    q_base: u32,
    // First key of this dispatch, and how many: a multiple of 32.
    key0: u32,
    keys: u32,
    // Row of out at the start of its binding, and the numbers that precede it there.
    out_row0: u32,
    out_skip: u32,
    flags: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Row of q and state within their bindings: query q of the dispatch's i-th head.
fn row_of(i: u32, q: u32) -> u32 {
    return i * p.nq_pad + q - p.q_base;
}

// Index in vec4, with TWOS in vec2, of channel 0 of query q of the dispatch's i-th head within the binding of out.
fn out_of(i: u32, q: u32) -> u32 {
    let head = p.head0 + i;
    let row = head / p.heads * p.nq + q - p.out_row0;
#if TWOS
    return (row * p.heads * p.head_dim + head % p.heads * p.head_dim + p.out_skip) / 2u;
#else
    return (row * p.heads * p.head_dim + head % p.heads * p.head_dim + p.out_skip) / 4u;
#endif
}
