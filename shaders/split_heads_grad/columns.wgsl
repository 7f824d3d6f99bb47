// split_heads_grad, columns, any WebGPU device: see lib/split_heads_grad_params for the equations and the order of the sums.
//
// An invocation owns a channel of a head (lib/value: four of them, with RoPE D must then be a multiple of 16) of a section of the rows
// of tokens. dweight and dbias get the sums of sections and heads side by side.
#import split_heads_grad_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> table: array<Stored>;
@group(0) @binding(3) var<storage, read> dy: array<Stored>;
@group(0) @binding(4) var<storage, read> stats: array<vec2<f32>>;
@group(0) @binding(5) var<storage, read_write> dweight: array<Stored>;
@group(0) @binding(6) var<storage, read_write> dbias: array<Stored>;

#if VEC4
const UNIT: u32 = 4u;
#else
#if QUAD
const UNIT: u32 = 4u;
#else
const UNIT: u32 = 1u;
#endif
#endif

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    // Channels of a head, and of the heads of this dispatch, in units.
    let width = p.head_dim / UNIT;
    let columns = p.head_count * width;
    let section = index / columns;
    let first = section * p.section;
    if (first >= p.m) {
        return;
    }
    let end = min(first + p.section, p.m);
    let head = p.head0 + (index - section * columns) / width;
    let d = index % width;
    let place = section * (p.step / UNIT) + head * width + d;
    let rope = (p.flags & ROPE) != 0u;
    // The partner of d and the cosine of both, in units; the partner's sign.
    let quarter = max(width / 4u, 1u);
    let is_first = d % (quarter * 2u) < quarter;
    let partner = select(d, select(d - min(quarter, d), d + quarter, is_first), rope);
    let angle = d / (quarter * 2u) * quarter + d % quarter;
    let sign = select(-1.0, 1.0, is_first);
    var along = Value();
    var plain = Value();
    if ((p.flags & GO_ON) != 0u) {
        along = lib_value(dweight[p.weight_rest / UNIT + place]);
        plain = lib_value(dbias[p.bias_rest / UNIT + place]);
    }
    let row_of_tokens = p.first + first;
    var token = row_of_tokens % p.tokens;
    var turn = token % p.rope_rows;
    var dy_row = (row_of_tokens / p.tokens * p.heads + head) * p.tokens_pad + token - p.dy_row0;
    for (var part = first; part < end; part += PART) {
        var a = Value();
        var b = Value();
        let stop = min(part + PART, end);
        for (var r = part; r < stop; r++) {
            let at = dy_row * (p.dp / UNIT);
            var u = lib_value(dy[at + d]);
            if (rope) {
                let row = turn * width + angle;
                u = u * lib_value(table[row]) + lib_value(dy[at + partner]) * lib_value(table[row + width / 2u]) * sign;
            }
            u = u * p.scale;
            let row = p.first + r - p.row0;
            let known = stats[p.stats_rest + row * p.heads + head];
            let v = lib_value(x[(row * p.x_stride + p.x_offset) / UNIT + head * width + d]);
            a += u * ((v - known.x) * known.y);
            b += u;
            token += 1u;
            turn += 1u;
            dy_row += 1u;
            if (turn == p.rope_rows) {
                turn = 0u;
            }
            if (token == p.tokens) {
                token = 0u;
                turn = 0u;
                // Over the padding and the other heads.
                dy_row += p.heads * p.tokens_pad - p.tokens;
            }
        }
        along += a;
        plain += b;
    }
    dweight[p.weight_rest / UNIT + place] = lib_stored(along);
    dbias[p.bias_rest / UNIT + place] = lib_stored(plain);
}
