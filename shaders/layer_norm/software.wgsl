// layer_norm, software devices: see lib/layer_norm_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $ROWS consecutive rows; lane l takes the vec4 l, l + 8, …
// of a row, and three constant shuffles add the lanes up. No workgroup memory, no barrier.
// Needs c to be a multiple of 4.
#import layer_norm_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> weight: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> bias: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> y: array<vec4<f32>>;

// The sum of all components of all 8 lanes, the same bits in every lane.
fn total(v: vec4<f32>) -> f32 {
    var s = (v.x + v.y) + (v.z + v.w);
    s += subgroupShuffleXor(s, 1u);
    s += subgroupShuffleXor(s, 2u);
    s += subgroupShuffleXor(s, 4u);
    return s;
}

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let row0 = lib_fold(group, groups) * ${ROWS}u;
    if (row0 >= p.m) {
        return;
    }
    let c4 = p.c / 4u;
    let inverse = 1.0 / f32(p.c);
    for (var row = row0; row < min(row0 + ${ROWS}u, p.m); row++) {
        let first = row * c4;
        var sum = vec4<f32>(0.0);
        for (var i = lane; i < c4; i += 8u) {
            sum += x[first + i];
        }
        let mean = vec4<f32>(total(sum) * inverse);
        var squares = vec4<f32>(0.0);
        for (var i = lane; i < c4; i += 8u) {
            let d = x[first + i] - mean;
            squares = fma(d, d, squares);
        }
        let scale = vec4<f32>(1.0 / sqrt(total(squares) * inverse + p.eps));
        for (var i = lane; i < c4; i += 8u) {
            var v = (x[first + i] - mean) * scale;
            if ((p.flags & HAS_WEIGHT) != 0u) {
                v *= weight[i];
            }
            if ((p.flags & HAS_BIAS) != 0u) {
                v += bias[i];
            }
            y[first + i] = lib_activate(v, p.act);
        }
    }
}
