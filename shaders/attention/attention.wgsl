// attention, any WebGPU device: see lib/attention_params for the equation and the shapes.
//
// An invocation owns a query row: its $DP sums live in registers, keys come four at a time (one vec4 of a
// transposed block), values one row at a time. No workgroup memory: right everywhere, fast nowhere.
#import attention_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> out: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> state: array<vec2<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let i = index / p.q_count;
    let query = p.q0 + index % p.q_count;
    if (i >= p.head_count || query >= p.nq) {
        return;
    }
    let row = row_of(i, query);
    let to = out_of(i, query);
    let d4 = p.head_dim / 4u;
    var m = NEVER;
    var l = 0.0;
#for v in 0..${DP/4}
    var o$v = vec4<f32>(0.0);
#end
    if ((p.flags & FIRST) == 0u) {
        let before = state[row];
        m = before.x;
        l = before.y;
#for v in 0..${DP/4}
        if (${v}u < d4) {
            o$v = out[to + ${v}u];
        }
#end
    }
    let q_at = row * ${DP/4}u;
    let kv = i * p.kv_pad * ${DP/4}u;
    // Groups of four keys that hold at least one real key.
    let fours = min(p.keys, p.nk - p.key0 + 3u) / 4u;
    for (var four = 0u; four < fours; four++) {
        var s = vec4<f32>(0.0);
        var at = kv + four / 8u * ${DP*8}u + four % 8u;
        for (var d = 0u; d < ${DP/4}u; d++) {
            let a = q[q_at + d];
            s = fma(vec4<f32>(a.x), k[at], s);
            s = fma(vec4<f32>(a.y), k[at + 8u], s);
            s = fma(vec4<f32>(a.z), k[at + 16u], s);
            s = fma(vec4<f32>(a.w), k[at + 24u], s);
            at += 32u;
        }
        let key = vec4<u32>(p.key0 + four * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        s = select(s, vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
        let m_new = max(m, max(max(s.x, s.y), max(s.z, s.w)));
        let fade = exp(m - m_new);
        m = m_new;
        s = exp(s - vec4<f32>(m));
        l = l * fade + ((s.x + s.y) + (s.z + s.w));
#for v in 0..${DP/4}
        o$v *= fade;
#end
        at = kv + four * ${DP}u;
        for (var c = 0u; c < 4u; c++) {
            let weight = vec4<f32>(s[c]);
#for v in 0..${DP/4}
            o$v = fma(weight, v[at + ${v}u], o$v);
#end
            at += ${DP/4}u;
        }
    }
    var scale = 1.0;
    if ((p.flags & LAST) != 0u) {
        scale = 1.0 / l;
    } else {
        state[row] = vec2<f32>(m, l);
    }
#for v in 0..${DP/4}
    if (${v}u < d4) {
        out[to + ${v}u] = o$v * scale;
    }
#end
}
