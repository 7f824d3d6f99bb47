// attention, any WebGPU device: see lib/attention_params for the equation and the shapes.
//
// An invocation owns a query row: keys come four at a time (one vec4 of a transposed block), values one row at a
// time. The sums are an array with a loop index, so that one small shader serves every head width and compiles quickly
// on drivers that unroll badly. No workgroup memory: right everywhere, fast nowhere. With TWOS the heads of out start at
// multiples of two channels instead of four; the inputs are padded, so only loads and stores of out differ.
#import attention_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
#if TWOS
@group(0) @binding(4) var<storage, read_write> out: array<vec2<f32>>;
#else
@group(0) @binding(4) var<storage, read_write> out: array<vec4<f32>>;
#endif
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
    let d4 = (p.head_dim + 3u) / 4u;
    var m = NEVER;
    var l = 0.0;
    // 128 channels; Params decide how many are in use.
    var sums: array<vec4<f32>, 32>;
    for (var c = 0u; c < d4; c++) {
        sums[c] = vec4<f32>(0.0);
    }
    if ((p.flags & FIRST) == 0u) {
        let before = state[row];
        m = before.x;
        l = before.y;
        for (var c = 0u; c < d4; c++) {
#if TWOS
            var last = vec2<f32>(0.0);
            if (c * 4u + 2u < p.head_dim) {
                last = out[to + c * 2u + 1u];
            }
            sums[c] = vec4<f32>(out[to + c * 2u], last);
#else
            sums[c] = out[to + c];
#endif
        }
    }
    // vec4 of a padded row.
    let dp4 = (d4 + 7u) / 8u * 8u;
    let q_at = row * dp4;
    let kv = i * p.kv_pad * dp4;
    // Groups of four keys that hold at least one real key.
    let fours = min(p.keys, p.nk - p.key0 + 3u) / 4u;
    for (var four = 0u; four < fours; four++) {
        var s = vec4<f32>(0.0);
        var at = kv + four / 8u * 32u * dp4 + four % 8u;
        for (var d = 0u; d < d4; d++) {
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
        at = kv + four * 4u * dp4;
        for (var c = 0u; c < d4; c++) {
            var sum = sums[c] * fade;
            sum = fma(vec4<f32>(s.x), v[at + c], sum);
            sum = fma(vec4<f32>(s.y), v[at + c + dp4], sum);
            sum = fma(vec4<f32>(s.z), v[at + c + 2u * dp4], sum);
            sums[c] = fma(vec4<f32>(s.w), v[at + c + 3u * dp4], sum);
        }
    }
    var scale = 1.0;
    if ((p.flags & LAST) != 0u) {
        scale = 1.0 / l;
    }
    if ((p.flags & KEEP) != 0u) {
        state[row] = vec2<f32>(m, l);
    }
    for (var c = 0u; c < d4; c++) {
#if TWOS
        let sum = sums[c] * scale;
        out[to + c * 2u] = sum.xy;
        if (c * 4u + 2u < p.head_dim) {
            out[to + c * 2u + 1u] = sum.zw;
        }
#else
        out[to + c] = sums[c] * scale;
#endif
    }
}
