// linear, any WebGPU device: see lib/linear_params for the equation and the shapes.
//
// An invocation owns 4 rows x 4 columns; x is read one number at a time so that every m, n and k is
// allowed. No workgroup memory: right everywhere, fast nowhere.
#import linear_params
#import grid
#import packed_storage

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read> gamma: array<f32>;
@group(0) @binding(5) var<storage, read> residual: array<f32>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;

fn finish(sum: vec4<f32>, row: u32, column: u32) {
    if (row >= p.m) {
        return;
    }
    let v = lib_activate(lib_scaled(sum, column) + bias4(column), p.act);
    for (var i = 0u; i < 4u; i++) {
        let n = column + i;
        if (n < p.n) {
            var out = v[i];
            if ((p.flags & HAS_GAMMA) != 0u) {
                out *= gamma[n];
            }
            if ((p.flags & HAS_RESIDUAL) != 0u) {
                out += residual[row * p.n + n];
            }
            y[row * p.n + n] = out;
        }
    }
}

fn bias4(column: u32) -> vec4<f32> {
    var v = vec4<f32>(0.0);
    if ((p.flags & HAS_BIAS) != 0u) {
        for (var i = 0u; i < 4u; i++) {
            if (column + i < p.n) {
                v[i] = bias[column + i];
            }
        }
    }
    return v;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups) * 64u + local.x;
    let columns = p.blocks * 8u;
    let column4 = tile % columns;
    let row = tile / columns * 4u;
    let column = p.n0 + column4 * 4u;
    if (row >= p.m || column >= p.n) {
        return;
    }
    let block = column4 / 8u;
    let lane = column4 % 8u;
#for i in 0..4
    let x$i = min(row + ${i}u, p.m - 1u) * p.k;
    var c$i = vec4<f32>(0.0);
#end
    for (var k = 0u; k < p.k; k++) {
        let b = lib_weight(block, k, lane);
#for i in 0..4
        c$i = fma(vec4<f32>(x[x$i + k]), b, c$i);
#end
    }
#for i in 0..4
    finish(c$i, row + ${i}u, column);
#end
}
