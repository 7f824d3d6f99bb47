// layer_norm_grad, columns, any WebGPU device: see lib/layer_norm_grad_params for the equations and the order of the sums.
//
// An invocation owns a channel (lib/value: four of them) of a section of the rows.
#import layer_norm_grad_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> dy: array<Stored>;
@group(0) @binding(3) var<storage, read> stats: array<vec2<f32>>;
@group(0) @binding(4) var<storage, read_write> dweight: array<Stored>;
@group(0) @binding(5) var<storage, read_write> dbias: array<Stored>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let section = index / p.c;
    let first = section * p.section;
    if (first >= p.m) {
        return;
    }
    let channel = index - section * p.c;
    let end = min(first + p.section, p.m);
    let on = (p.flags & GO_ON) != 0u;
    var along = Value();
    var plain = Value();
    if (on && (p.flags & D_WEIGHT) != 0u) {
        along = lib_value(dweight[p.weight_rest + index]);
    }
    if (on && (p.flags & D_BIAS) != 0u) {
        plain = lib_value(dbias[p.bias_rest + index]);
    }
    for (var part = first; part < end; part += PART) {
        var a = Value();
        var b = Value();
        let stop = min(part + PART, end);
        for (var row = part; row < stop; row++) {
            let known = stats[row];
            let d = lib_value(dy[row * p.c + channel]);
            a += d * ((lib_value(x[row * p.c + channel]) - known.x) * known.y);
            b += d;
        }
        along += a;
        plain += b;
    }
    if ((p.flags & D_WEIGHT) != 0u) {
        dweight[p.weight_rest + index] = lib_stored(along);
    }
    if ((p.flags & D_BIAS) != 0u) {
        dbias[p.bias_rest + index] = lib_stored(plain);
    }
}
