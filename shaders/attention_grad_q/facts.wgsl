// attention_grad_q, what gradients need to know of each query, any WebGPU device: see lib/attention_grad_params.
//
//   top[i] = m[i] + log(l[i]),   delta[i] = sum_d g[i, d] out[i, d]
//
// An invocation owns a query of a head. out is [groups nq, heads D], g in padded rows. Rows of padding get a top that makes every weight 0.
#import attention_grad_params
#import grid

@group(0) @binding(1) var<storage, read> out: array<f32>;
@group(0) @binding(2) var<storage, read> g: array<f32>;
@group(0) @binding(3) var<storage, read> state: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> facts: array<f32>;

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
    var top = -NEVER;
    var delta = 0.0;
    if (query < p.nq) {
        let head = p.head0 + i;
        let row = query_row(i, query);
        let at = row * p.dp4 * 4u;
        let from_out = p.out_skip + (head / p.heads * p.nq + query - p.out_row0) * p.heads * p.head_dim + head % p.heads * p.head_dim;
        for (var d = 0u; d < p.head_dim; d++) {
            delta = fma(g[at + d], out[from_out + d], delta);
        }
        let kept = state[row];
        top = kept.x + log(kept.y);
    }
    let to = i * 2u * p.nq_pad + query;
    facts[to] = top;
    facts[to + p.nq_pad] = delta;
}
