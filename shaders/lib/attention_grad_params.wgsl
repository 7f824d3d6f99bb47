// What all variants of `attention_grad_q` and `attention_grad_kv` share: parameters and indices.
//
// With scores s[i, j] = q[i] . k[j], p = softmax_j(s), out[i] = sum_j p[i, j] v[j] and the gradient g of out, a head and group at a time:
//
//   f[i, j] = p[i, j] (g[i] . v[j] - delta[i]),   delta[i] = g[i] . out[i]
//   dq[i] = sum_j f[i, j] k[j]      dk[j] = sum_i f[i, j] q[i]      dv[j] = sum_i p[i, j] g[i]
//
// p[i, j] = exp(s[i, j] - top[i]), top = m + log(l) from the state that `attention` keeps: no score is stored. q and dq, v and dv, g and
// dk are in rows [groups][heads][n_pad][Dp], k in blocks [groups][heads][nk_pad / 32][Dp][32], all padding zero (see
// lib/attention_params); facts [groups][heads][2][nq_pad] are top and delta. Padded queries have a top that no score reaches.
//
// One gradient is summed in rows that an invocation, or a group of them, owns (queries for dq, keys for dk and dv), while rows of the
// other kind stream by in windows; their order is that of one long window.

// First window of streaming rows: nothing to go on from.
const FIRST: u32 = 1u;
// A score that never counts.
const NEVER: f32 = -1e30;

struct Params {
    // Queries and keys of a group, and their padded numbers.
    nq: u32,
    nk: u32,
    nq_pad: u32,
    nk_pad: u32,
    // Channels of a head, and the vec4 of a padded row.
    head_dim: u32,
    dp4: u32,
    // Heads of this dispatch, counted over the groups.
    head_count: u32,
    // First row that is owned, and how many, multiples of 32; the row at the start of the bindings of what is owned.
    own0: u32,
    own_count: u32,
    own_base: u32,
    // First streaming row and how many, multiples of 32. Bindings begin with it.
    stream0: u32,
    stream_count: u32,
    flags: u32,
    // facts: first (group, head), queries a row of out holds, and where rows of out begin in its binding.
    head0: u32,
    heads: u32,
    out_row0: u32,
    out_skip: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;

// Row, within the bindings of what queries own, of query q of the dispatch's i-th head.
fn query_row(i: u32, q: u32) -> u32 {
    return i * p.nq_pad + q - p.own_base;
}

// The same for keys.
fn key_row(i: u32, k: u32) -> u32 {
    return i * p.nk_pad + k - p.own_base;
}
