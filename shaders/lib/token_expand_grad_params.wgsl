// What the passes of `token_expand_grad` share: its parameters.
//
// The gradient of z[t, r, :] = q[r, :] (1 + alpha[r] scale[t, :]) + kappa[r] shift[t, :] with q [m, d], scale and shift [T, d],
// alpha and kappa [m], dz [T, m, d]; what is absent has the value 0 (scale) or 1 (alpha, kappa), and its gradient is that at
// this value.
//
//   sums[r, 0, :] = sum_t dz[t, r, :]     sums[r, 1, :] = sum_t dz scale     sums[r, 2, :] = sum_t dz shift
//   dq[r, :] = sums[r, 0, :] + alpha[r] sums[r, 1, :]
//   drow[r, 0] = dalpha[r] = sum_c q sums[r, 1, c]     drow[r, 1] = dkappa[r] = sum_c sums[r, 2, c]
//   parts[t, b, 0, :] = sum_{r in block b} dz q alpha[r]     parts[t, b, 1, :] = sum_{r in block b} dz kappa[r]
//   dtime[t, 0, :] = dscale[t, :] = sum_b parts[t, b, 0, :]     dtime[t, 1, :] = dshift[t, :] = sum_b parts[t, b, 1, :]

const HAS_SCALE: u32 = 1u;
const HAS_ALPHA: u32 = 2u;
const HAS_KAPPA: u32 = 4u;
// Whether the sums hold what came before the first element of this dispatch.
const GO_ON: u32 = 8u;

struct Params {
    // Tokens and times of this dispatch, tokens in all, elements of the channels (see lib/value).
    rows: u32,
    times: u32,
    stride: u32,
    d: u32,
    flags: u32,
    // Tokens of a block, and blocks of this dispatch.
    block: u32,
    parts: u32,
    // Distances of the first element, of alpha, kappa and drow of the first word, from the start of the windows; out is what the pass writes.
    q_rest: u32,
    scale_rest: u32,
    shift_rest: u32,
    alpha_rest: u32,
    kappa_rest: u32,
    dz_rest: u32,
    sums_rest: u32,
    out_rest: u32,
    row_rest: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
