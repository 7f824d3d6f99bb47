// split_heads (RoPE and the q/k norm are here), four channels at a time: see lib/split_heads_params.
//
// An invocation owns one token of one head. Channels come as vec4, and the two vec4 of a RoPE pair are
// read and turned together, so nothing is read twice but for the norm. Needs the rows and heads of x to start at
// multiples of 4 channels and D to be one, with RoPE of 16. With ROWS y has rows, and takes four at a time too.
//
// The norm's statistics are of one pass: a mean of what was read and the sum of squares around it, four numbers at a time
// joined to them (Chan, Golub, LeVeque 1983).
#import split_heads_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> weight: array<Stored>;
@group(0) @binding(3) var<storage, read> bias: array<Stored>;
@group(0) @binding(4) var<storage, read> table: array<Stored>;
#if ROWS
@group(0) @binding(5) var<storage, read_write> y: array<Stored>;
#else
@group(0) @binding(5) var<storage, read_write> y: array<f32>;
#endif

fn normal(v: vec4<f32>, d4: u32, mean: f32, inverse: f32) -> vec4<f32> {
    if ((p.flags & NORM) != 0u) {
        return (v - mean) * inverse * lib_value(weight[d4]) + lib_value(bias[d4]);
    }
    return v;
}

fn put(to: u32, d4: u32, step: u32, v: vec4<f32>) {
    let scaled = v * p.scale;
#if ROWS
    y[to / 4u + d4] = lib_stored(scaled);
#else
    let at = to + d4 * 4u * step;
    y[at] = scaled.x;
    y[at + step] = scaled.y;
    y[at + 2u * step] = scaled.z;
    y[at + 3u * step] = scaled.w;
#endif
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
    let n4 = p.head_dim / 4u;
    var written = 0u;
    if (t < p.tokens) {
        let head = p.head0 + i;
        let row = head / p.heads * p.tokens + t - p.x_row0;
        let at = (row * p.x_stride + p.x_offset + head % p.heads * p.head_dim) / 4u;
        var mean = 0.0;
        var inverse = 1.0;
        if ((p.flags & NORM) != 0u) {
            var count = 0.0;
            var squares = 0.0;
            for (var d = 0u; d < n4; d++) {
                let v = lib_value(x[at + d]);
                let middle = ((v.x + v.y) + (v.z + v.w)) * 0.25;
                let e = v - vec4<f32>(middle);
                let share = 4.0 / (count + 4.0);
                let apart = middle - mean;
                mean = fma(apart, share, mean);
                squares += fma(apart * apart, count * share, dot(e, e));
                count += 4.0;
            }
            inverse = 1.0 / sqrt(squares / count + p.eps);
        }
        if ((p.flags & ROPE) != 0u) {
            let angles = t % p.rope_rows * n4;
            let quarter = n4 / 4u;
            for (var j = 0u; j < n4 / 2u; j++) {
                // The j-th vec4 of angles: its half, and the channels of that half.
                let a = j / quarter * quarter * 2u + j % quarter;
                let b = a + quarter;
                let turned = lib_rope_turn4(normal(lib_value(x[at + a]), a, mean, inverse),
                    normal(lib_value(x[at + b]), b, mean, inverse),
                    lib_value(table[angles + j]), lib_value(table[angles + n4 / 2u + j]));
                put(to, a, step, turned.first);
                put(to, b, step, turned.second);
            }
        } else {
            for (var d = 0u; d < n4; d++) {
                put(to, d, step, normal(lib_value(x[at + d]), d, mean, inverse));
            }
        }
        written = n4;
    }
    for (var d = written; d < p.dp / 4u; d++) {
        put(to, d, step, vec4<f32>(0.0));
    }
}
