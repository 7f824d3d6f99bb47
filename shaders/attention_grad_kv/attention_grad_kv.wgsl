// attention_grad_kv, any WebGPU device: see lib/attention_grad_params for the equation and the shapes.
//
// An invocation owns a key; queries come one row at a time. The key, its value and the sums are arrays with a loop index, so that
// one small shader serves every head width. No workgroup memory: right everywhere, fast nowhere.
#import attention_grad_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<f32>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read> g: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read> facts: array<f32>;
@group(0) @binding(6) var<storage, read_write> dk: array<vec4<f32>>;
@group(0) @binding(7) var<storage, read_write> dv: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let i = index / p.own_count;
    let key = p.own0 + index % p.own_count;
    if (i >= p.head_count) {
        return;
    }
    let dp4 = p.dp4;
    let d4 = (p.head_dim + 3u) / 4u;
    let row = key_row(i, key);
    let mine = key < p.nk;
    // Channel 0 of the key in its block.
    let block = row / 32u * 128u * dp4 + row % 32u;
    // 128 channels; Params decide how many are in use.
    var a: array<vec4<f32>, 32>;
    var b: array<vec4<f32>, 32>;
    var sums_k: array<vec4<f32>, 32>;
    var sums_v: array<vec4<f32>, 32>;
    for (var c = 0u; c < dp4; c++) {
        let at = block + c * 128u;
        a[c] = vec4<f32>(k[at], k[at + 32u], k[at + 64u], k[at + 96u]);
        b[c] = v[row * dp4 + c];
        sums_k[c] = vec4<f32>(0.0);
        sums_v[c] = vec4<f32>(0.0);
        if ((p.flags & FIRST) == 0u) {
            sums_k[c] = dk[row * dp4 + c];
            sums_v[c] = dv[row * dp4 + c];
        }
    }
    let count = select(0u, min(p.stream_count, p.nq - p.stream0), mine);
    for (var n = 0u; n < count; n++) {
        let at = (i * p.nq_pad + n) * dp4;
        var s = 0.0;
        var e = 0.0;
        for (var c = 0u; c < d4; c++) {
            s += dot(a[c], q[at + c]);
            e += dot(b[c], g[at + c]);
        }
        let fact = i * 2u * p.nq_pad + p.stream0 + n;
        let weight = exp(s - facts[fact]);
        let f = weight * (e - facts[fact + p.nq_pad]);
        for (var c = 0u; c < d4; c++) {
            sums_k[c] = fma(vec4<f32>(f), q[at + c], sums_k[c]);
            sums_v[c] = fma(vec4<f32>(weight), g[at + c], sums_v[c]);
        }
    }
    for (var c = 0u; c < dp4; c++) {
        dk[row * dp4 + c] = sums_k[c];
        dv[row * dp4 + c] = sums_v[c];
    }
}
