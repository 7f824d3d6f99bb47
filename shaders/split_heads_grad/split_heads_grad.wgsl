// split_heads_grad, heads, any shape: see lib/split_heads_grad_params for the equations.
//
// An invocation owns one token of one head and walks its D channels: three times for the norm, once to write. Channels are read
// one at a time, a RoPE partner a second time, so that every D and offset is allowed.
#import split_heads_grad_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> weight: array<f32>;
@group(0) @binding(3) var<storage, read> table: array<f32>;
@group(0) @binding(4) var<storage, read> dy: array<f32>;
@group(0) @binding(5) var<storage, read_write> dx: array<f32>;
@group(0) @binding(6) var<storage, read_write> stats: array<vec2<f32>>;

// Channel d of the gradient at `at`, turned back.
fn turned(at: u32, angles: u32, d: u32) -> f32 {
    var v = dy[at + d];
    if ((p.flags & ROPE) != 0u) {
        let first = lib_rope_first(d, p.head_dim);
        let quarter = p.head_dim / 4u;
        let other = dy[at + select(d - quarter, d + quarter, first)];
        let angle = angles + lib_rope_angle(d, p.head_dim);
        v = lib_rope_turn(v, other, table[angle], -table[angle + p.head_dim / 2u], first);
    }
    return v * p.scale;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let i = index / p.t_count;
    let t = p.t0 + index % p.t_count;
    if (i >= p.head_count || t >= p.tokens) {
        return;
    }
    let head = p.head0 + i;
    let row = head / p.heads * p.tokens + t - p.row0;
    let column = head % p.heads * p.head_dim;
    let to = row * p.dx_stride + p.dx_offset + column;
    let at = (head * p.tokens_pad + t - p.dy_row0) * p.dp;
    let angles = t % p.rope_rows * p.head_dim;
    if ((p.flags & NORM) == 0u) {
        for (var d = 0u; d < p.head_dim; d++) {
            dx[to + d] = turned(at, angles, d);
        }
        return;
    }
    let of_x = row * p.x_stride + p.x_offset + column;
    let count = f32(p.head_dim);
    var sum = 0.0;
    for (var d = 0u; d < p.head_dim; d++) {
        sum += x[of_x + d];
    }
    let mean = sum / count;
    var squares = 0.0;
    for (var d = 0u; d < p.head_dim; d++) {
        let e = x[of_x + d] - mean;
        squares += e * e;
    }
    let inverse = 1.0 / sqrt(squares / count + p.eps);
    stats[p.stats_rest + row * p.heads + head % p.heads] = vec2<f32>(mean, inverse);
    var plain = 0.0;
    var along = 0.0;
    for (var d = 0u; d < p.head_dim; d++) {
        let g = turned(at, angles, d) * weight[d];
        plain += g;
        along += g * ((x[of_x + d] - mean) * inverse);
    }
    plain /= count;
    along /= count;
    for (var d = 0u; d < p.head_dim; d++) {
        let g = turned(at, angles, d) * weight[d];
        dx[to + d] = inverse * ((g - plain) - (x[of_x + d] - mean) * inverse * along);
    }
}
