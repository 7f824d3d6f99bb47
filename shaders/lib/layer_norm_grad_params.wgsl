// What all variants of `layer_norm_grad` share: parameters and flags.
//
//   n[m, c] = (x[m, c] - mean_m) scale_m,  scale_m = 1 / sqrt(var_m + eps),  g[m, c] = dy[m, c] weight[c]
//   dx[m, c] = scale_m (g[m, c] - mean_c g[m, c] - n[m, c] mean_c(g[m, c] n[m, c]))
//   dweight[c] = sum_m dy[m, c] n[m, c],  dbias[c] = sum_m dy[m, c]
//
// x, dy, dx [m, c]; weight, dweight, dbias [c]; mean and variance (divisor c) over the channels of a row. Rows leave their mean and
// scale in stats [m][2], from which the columns take n. The rows of a column's sum are cut into sections and parts as those of
// `linear_weights`.

const HAS_WEIGHT: u32 = 1u;
// Which sums over rows are wanted, and that they go on from what the output holds.
const D_WEIGHT: u32 = 2u;
const D_BIAS: u32 = 4u;
const GO_ON: u32 = 8u;
// Rows of a part.
const PART: u32 = 64u;

struct Params {
    // Rows of this dispatch.
    m: u32,
    // Channels; `columns`: in the unit of the variant.
    c: u32,
    flags: u32,
    eps: f32,
    // `columns`: rows of a section, sections, distance of the first sum from the start of the outputs' windows, in the unit.
    section: u32,
    weight_rest: u32,
    bias_rest: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
