// split_heads_grad, heads, four channels at a time: see lib/split_heads_grad_params for the equations.
//
// An invocation owns one token of one head. Channels come as vec4; statistics are of one pass, as in `split_heads`. Needs the
// rows and heads of x and dx to start at multiples of 4 channels and D to be one, with RoPE of 16.
#import split_heads_grad_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> weight: array<Stored>;
@group(0) @binding(3) var<storage, read> table: array<Stored>;
@group(0) @binding(4) var<storage, read> dy: array<Stored>;
@group(0) @binding(5) var<storage, read_write> dx: array<Stored>;
@group(0) @binding(6) var<storage, read_write> stats: array<vec2<f32>>;

// Vec4 j of the gradient at `at`, turned back: of the halves' first channels, and their partners `quarter` vec4 further on.
fn turned(at: u32, angles: u32, j: u32, n4: u32) -> LibRopePair {
    let quarter = n4 / 4u;
    let a = j / quarter * quarter * 2u + j % quarter;
    let pair = lib_rope_turn4(lib_value(dy[at + a]), lib_value(dy[at + a + quarter]),
        lib_value(table[angles + j]), -lib_value(table[angles + n4 / 2u + j]));
    return LibRopePair(pair.first * p.scale, pair.second * p.scale);
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
    let to = (row * p.dx_stride + p.dx_offset + column) / 4u;
    let of_x = (row * p.x_stride + p.x_offset + column) / 4u;
    let at = (head * p.tokens_pad + t - p.dy_row0) * p.dp / 4u;
    let n4 = p.head_dim / 4u;
    let angles = t % p.rope_rows * n4;
    let normed = (p.flags & NORM) != 0u;
    var mean = 0.0;
    var inverse = 1.0;
    if (normed) {
        var count = 0.0;
        var squares = 0.0;
        for (var d = 0u; d < n4; d++) {
            let v = lib_value(x[of_x + d]);
            let middle = ((v.x + v.y) + (v.z + v.w)) * 0.25;
            let e = v - vec4<f32>(middle);
            let share = 4.0 / (count + 4.0);
            let apart = middle - mean;
            mean = fma(apart, share, mean);
            squares += fma(apart * apart, count * share, dot(e, e));
            count += 4.0;
        }
        inverse = 1.0 / sqrt(squares / count + p.eps);
        stats[p.stats_rest + row * p.heads + head % p.heads] = vec2<f32>(mean, inverse);
    }
    var plain = 0.0;
    var along = 0.0;
    if ((p.flags & ROPE) != 0u) {
        let quarter = n4 / 4u;
        if (normed) {
            for (var j = 0u; j < n4 / 2u; j++) {
                let a = j / quarter * quarter * 2u + j % quarter;
                let u = turned(at, angles, j, n4);
                let g = u.first * lib_value(weight[a]);
                let h = u.second * lib_value(weight[a + quarter]);
                plain += dot(g, vec4<f32>(1.0)) + dot(h, vec4<f32>(1.0));
                along += dot(g, (lib_value(x[of_x + a]) - mean) * inverse) + dot(h, (lib_value(x[of_x + a + quarter]) - mean) * inverse);
            }
            plain /= f32(p.head_dim);
            along /= f32(p.head_dim);
        }
        for (var j = 0u; j < n4 / 2u; j++) {
            let a = j / quarter * quarter * 2u + j % quarter;
            let b = a + quarter;
            let u = turned(at, angles, j, n4);
            var first = u.first;
            var second = u.second;
            if (normed) {
                first = inverse * ((first * lib_value(weight[a]) - plain) - (lib_value(x[of_x + a]) - mean) * inverse * along);
                second = inverse * ((second * lib_value(weight[b]) - plain) - (lib_value(x[of_x + b]) - mean) * inverse * along);
            }
            dx[to + a] = lib_stored(first);
            dx[to + b] = lib_stored(second);
        }
        return;
    }
    if (normed) {
        for (var d = 0u; d < n4; d++) {
            let g = lib_value(dy[at + d]) * p.scale * lib_value(weight[d]);
            plain += dot(g, vec4<f32>(1.0));
            along += dot(g, (lib_value(x[of_x + d]) - mean) * inverse);
        }
        plain /= f32(p.head_dim);
        along /= f32(p.head_dim);
    }
    for (var d = 0u; d < n4; d++) {
        var v = lib_value(dy[at + d]) * p.scale;
        if (normed) {
            v = inverse * ((v * lib_value(weight[d]) - plain) - (lib_value(x[of_x + d]) - mean) * inverse * along);
        }
        dx[to + d] = lib_stored(v);
    }
}
