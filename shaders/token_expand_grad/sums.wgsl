// token_expand_grad, sums over times; see lib/token_expand_grad_params for the equations.
//
// An invocation owns a token and an element of its channels (see lib/value), and walks the times in order. Times may come in several dispatches.
#import token_expand_grad_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> scale: array<Stored>;
@group(0) @binding(2) var<storage, read> shift: array<Stored>;
@group(0) @binding(3) var<storage, read> dz: array<Stored>;
@group(0) @binding(4) var<storage, read_write> sums: array<Stored>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    if (index >= p.rows * p.d) {
        return;
    }
    let r = index / p.d;
    let c = index - r * p.d;
    let to = p.out_rest + r * 3u * p.d + c;
    var plain = Value();
    var scaled = Value();
    var shifted = Value();
    if ((p.flags & GO_ON) != 0u) {
        plain = lib_value(sums[to]);
        scaled = lib_value(sums[to + p.d]);
        shifted = lib_value(sums[to + 2u * p.d]);
    }
    let has_scale = (p.flags & HAS_SCALE) != 0u;
    var at = p.dz_rest + index;
    for (var t = 0u; t < p.times; t++) {
        let g = lib_value(dz[at]);
        plain += g;
        shifted = fma(g, lib_value(shift[p.shift_rest + t * p.d + c]), shifted);
        if (has_scale) {
            scaled = fma(g, lib_value(scale[p.scale_rest + t * p.d + c]), scaled);
        }
        at += p.stride * p.d;
    }
    sums[to] = lib_stored(plain);
    sums[to + p.d] = lib_stored(scaled);
    sums[to + 2u * p.d] = lib_stored(shifted);
}
