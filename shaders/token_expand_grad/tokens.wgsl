// token_expand_grad, tokens and their two numbers; see lib/token_expand_grad_params for the equations.
//
// A workgroup owns a token: each invocation every 64th channel, then halves of their sums are joined until one is left.
#import token_expand_grad_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<f32>;
@group(0) @binding(2) var<storage, read> alpha: array<f32>;
@group(0) @binding(3) var<storage, read> sums: array<f32>;
@group(0) @binding(4) var<storage, read_write> dq: array<f32>;
@group(0) @binding(5) var<storage, read_write> drow: array<f32>;

var<workgroup> joined: array<vec2<f32>, 64>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups);
    // Workgroups past the end repeat the last token, so that barriers stay uniform.
    let r = min(index, p.rows - 1u);
    var a = 1.0;
    if ((p.flags & HAS_ALPHA) != 0u) {
        a = alpha[p.alpha_rest + r];
    }
    let source = p.sums_rest + r * 3u * p.d;
    var sum = vec2<f32>(0.0);
    for (var c = local.x; c < p.d; c += 64u) {
        let scaled = sums[source + p.d + c];
        // q and dq have one place.
        let at = p.q_rest + r * p.d + c;
        dq[at] = fma(a, scaled, sums[source + c]);
        sum += vec2<f32>(q[at] * scaled, sums[source + 2u * p.d + c]);
    }
    joined[local.x] = sum;
    workgroupBarrier();
    for (var span = 32u; span > 0u; span /= 2u) {
        if (local.x < span) {
            joined[local.x] += joined[local.x + span];
        }
        workgroupBarrier();
    }
    if (local.x == 0u && index == r) {
        drow[p.row_rest + r * 2u] = joined[0].x;
        drow[p.row_rest + r * 2u + 1u] = joined[0].y;
    }
}
