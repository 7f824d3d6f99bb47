// linear, GPUs: see lib/linear_params for the equation and the shapes.
//
// A workgroup of 16x16 owns 64 rows x 64 columns (two column blocks); 16 k at a time are staged in
// workgroup memory (8 KiB), x transposed so that an invocation reads its 4 rows as one vec4. An
// invocation owns 4x4. Any m, n, k.
//
// Roofline: 2*64*64*16 flop per 2*64*16*4 bytes staged = 16 flop a byte from memory, 8 from workgroup
// memory a vec4 pair; 40 registers an invocation leave full occupancy on current GPUs.
#import linear_params
#import grid
#import packed_storage

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read> gamma: array<f32>;
@group(0) @binding(5) var<storage, read> residual: array<f32>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;

const STEP: u32 = 16u;
// [k][row of 4]: 16 x 16 vec4.
var<workgroup> xs: array<vec4<f32>, 256>;
// [k][column of 4].
var<workgroup> ws: array<vec4<f32>, 256>;

fn weight(block: u32, k: u32, lane: u32) -> vec4<f32> {
    if (k >= p.k || block >= p.blocks) {
        return vec4<f32>(0.0);
    }
    return lib_weight(block, k, lane);
}

fn at(row: u32, k: u32) -> f32 {
    if (row < p.m && k < p.k) {
        return x[row * p.k + k];
    }
    return 0.0;
}

fn finish(sum: vec4<f32>, row: u32, column: u32) {
    if (row >= p.m) {
        return;
    }
    var v = sum;
    if ((p.flags & HAS_BIAS) != 0u) {
        for (var i = 0u; i < 4u; i++) {
            if (column + i < p.n) {
                v[i] += bias[column + i];
            }
        }
    }
    v = lib_activate(v, p.act);
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

@compute @workgroup_size(16, 16)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups);
    let wide = (p.blocks + 1u) / 2u;
    let column0 = tile % wide * 64u;
    let row0 = tile / wide * 64u;
#for i in 0..4
    var c$i = vec4<f32>(0.0);
#end
    // Which part of the tiles this invocation stages: x by (k, row of 4), w by (k, column of 4).
    let stage_k = index % STEP;
    let stage_4 = index / STEP;
    let w_k = index / STEP;
    let w_column = column0 + index % STEP * 4u;
    for (var k0 = 0u; k0 < p.k; k0 += STEP) {
        let row = row0 + stage_4 * 4u;
        xs[stage_k * STEP + stage_4] = vec4<f32>(
            at(row, k0 + stage_k), at(row + 1u, k0 + stage_k), at(row + 2u, k0 + stage_k), at(row + 3u, k0 + stage_k));
        ws[index] = weight(w_column / 32u, k0 + w_k, w_column % 32u / 4u);
        workgroupBarrier();
        for (var k = 0u; k < STEP; k++) {
            let a = xs[k * STEP + local.y];
            let b = ws[k * STEP + local.x];
#for i in 0..4
            c$i = fma(vec4<f32>(a[$i]), b, c$i);
#end
        }
        workgroupBarrier();
    }
#for i in 0..4
    finish(c$i, row0 + local.y * 4u + ${i}u, p.n0 + column0 + local.x * 4u);
#end
}
