// attention_grad_q, any WebGPU device: see lib/attention_grad_params for the equation and the shapes.
//
// An invocation owns a query; keys come four at a time (one vec4 of a transposed block), values one row at a time. The sums are
// an array with a loop index, so that one small shader serves every head width. No workgroup memory: right everywhere,
// fast nowhere.
#import attention_grad_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> g: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> facts: array<f32>;
@group(0) @binding(6) var<storage, read_write> dq: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let i = index / p.own_count;
    let query = p.own0 + index % p.own_count;
    if (i >= p.head_count) {
        return;
    }
    let dp4 = p.dp4;
    let d4 = (p.head_dim + 3u) / 4u;
    let row = query_row(i, query) * dp4;
    let fact = i * 2u * p.nq_pad + query;
    let top = facts[fact];
    let delta = facts[fact + p.nq_pad];
    // 128 channels; Params decide how many are in use.
    var sums: array<vec4<f32>, 32>;
    for (var c = 0u; c < dp4; c++) {
        sums[c] = vec4<f32>(0.0);
        if ((p.flags & FIRST) == 0u) {
            sums[c] = dq[row + c];
        }
    }
    let kv = i * p.nk_pad * dp4;
    // Groups of four keys that hold at least one real key.
    let fours = min(p.stream_count, p.nk - p.stream0 + 3u) / 4u;
    for (var four = 0u; four < fours; four++) {
        var s = vec4<f32>(0.0);
        var e = vec4<f32>(0.0);
        var at = kv + four / 8u * 32u * dp4 + four % 8u;
        var v_at = kv + four * 4u * dp4;
        for (var d = 0u; d < d4; d++) {
            let a = q[row + d];
            s = fma(vec4<f32>(a.x), k[at], s);
            s = fma(vec4<f32>(a.y), k[at + 8u], s);
            s = fma(vec4<f32>(a.z), k[at + 16u], s);
            s = fma(vec4<f32>(a.w), k[at + 24u], s);
            at += 32u;
            let b = g[row + d];
            e += vec4<f32>(dot(b, v[v_at]), dot(b, v[v_at + dp4]), dot(b, v[v_at + 2u * dp4]), dot(b, v[v_at + 3u * dp4]));
            v_at += 1u;
        }
        let key = vec4<u32>(p.stream0 + four * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        s = select(s, vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
        let f = exp(s - vec4<f32>(top)) * (e - vec4<f32>(delta));
        at = kv + four / 8u * 32u * dp4 + four % 8u;
        for (var c = 0u; c < d4; c++) {
            sums[c] += vec4<f32>(dot(f, k[at]), dot(f, k[at + 8u]), dot(f, k[at + 16u]), dot(f, k[at + 24u]));
            at += 32u;
        }
    }
    for (var c = 0u; c < dp4; c++) {
        dq[row + c] = sums[c];
    }
}
