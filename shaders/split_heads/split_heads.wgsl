// split_heads (RoPE and the q/k norm are here), any shape: see lib/split_heads_params for the equation.
//
// An invocation owns one token of one head and walks its D channels: twice for the norm, once to write.
// Channels are read one at a time, a RoPE partner a second time, so that every D and offset is allowed.
#import split_heads_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> weight: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read> table: array<f32>;
@group(0) @binding(5) var<storage, read_write> y: array<f32>;

fn normal(at: u32, d: u32, mean: f32, inverse: f32) -> f32 {
    let v = x[at + d];
    if ((p.flags & NORM) != 0u) {
        return (v - mean) * inverse * weight[d] + bias[d];
    }
    return v;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // Neighbouring invocations take neighbouring tokens: stores to key blocks are then contiguous.
    let index = lib_fold(group, groups) * 64u + local.x;
    let i = index / p.t_count;
    let t = p.t0 + index % p.t_count;
    if (i >= p.head_count) {
        return;
    }
    let to = place(i, t);
    let step = step_d();
    var written = 0u;
    if (t < p.tokens) {
        let head = p.head0 + i;
        let row = head / p.heads * p.tokens + t - p.x_row0;
        let at = row * p.x_stride + p.x_offset + head % p.heads * p.head_dim;
        var mean = 0.0;
        var inverse = 1.0;
        if ((p.flags & NORM) != 0u) {
            var sum = 0.0;
            for (var d = 0u; d < p.head_dim; d++) {
                sum += x[at + d];
            }
            mean = sum / f32(p.head_dim);
            var squares = 0.0;
            for (var d = 0u; d < p.head_dim; d++) {
                let e = x[at + d] - mean;
                squares += e * e;
            }
            inverse = 1.0 / sqrt(squares / f32(p.head_dim) + p.eps);
        }
        let angles = t % p.rope_rows * p.head_dim;
        for (var d = 0u; d < p.head_dim; d++) {
            var v = normal(at, d, mean, inverse);
            if ((p.flags & ROPE) != 0u) {
                let first = lib_rope_first(d, p.head_dim);
                let quarter = p.head_dim / 4u;
                let other = normal(at, select(d - quarter, d + quarter, first), mean, inverse);
                let angle = angles + lib_rope_angle(d, p.head_dim);
                v = lib_rope_turn(v, other, table[angle], table[angle + p.head_dim / 2u], first);
            }
            y[to + d * step] = v * p.scale;
        }
        written = p.head_dim;
    }
    for (var d = written; d < p.dp; d++) {
        y[to + d * step] = 0.0;
    }
}
