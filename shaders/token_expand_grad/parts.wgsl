// token_expand_grad, sums over a block of tokens; see lib/token_expand_grad_params for the equations.
//
// An invocation owns a time, a block and an element of the channels (see lib/value), and walks the tokens in order. A block may come in several dispatches.
#import token_expand_grad_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> q: array<Stored>;
@group(0) @binding(2) var<storage, read> alpha: array<f32>;
@group(0) @binding(3) var<storage, read> kappa: array<f32>;
@group(0) @binding(4) var<storage, read> dz: array<Stored>;
@group(0) @binding(5) var<storage, read_write> parts: array<Stored>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    if (index >= p.times * p.parts * p.d) {
        return;
    }
    let place = index / p.d;
    let c = index - place * p.d;
    let t = place / p.parts;
    let start = (place - t * p.parts) * p.block;
    let end = min(start + p.block, p.rows);
    let to = p.out_rest + place * 2u * p.d + c;
    var scaled = Value();
    var shifted = Value();
    if ((p.flags & GO_ON) != 0u) {
        scaled = lib_value(parts[to]);
        shifted = lib_value(parts[to + p.d]);
    }
    let has_alpha = (p.flags & HAS_ALPHA) != 0u;
    let has_kappa = (p.flags & HAS_KAPPA) != 0u;
    for (var r = start; r < end; r++) {
        let g = lib_value(dz[p.dz_rest + (t * p.stride + r) * p.d + c]);
        var token = lib_value(q[p.q_rest + r * p.d + c]);
        var k = 1.0;
        if (has_alpha) {
            token *= alpha[p.alpha_rest + r];
        }
        if (has_kappa) {
            k = kappa[p.kappa_rest + r];
        }
        scaled = fma(g, token, scaled);
        shifted = fma(g, Value(k), shifted);
    }
    parts[to] = lib_stored(scaled);
    parts[to + p.d] = lib_stored(shifted);
}
