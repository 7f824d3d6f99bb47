// The product of `linear` and `conv2d` on GPUs, pasted after what the importer says of its rows: `Row`, `tile_row(row)`,
// `tile_x(Row, k)` (four k of a row, 0 past the depth) and `finish(sum, row, column)`; `tile_rows()` and `tile_depth()`.
//
// A workgroup of 128 owns 64 rows x 64 columns (two column blocks), an invocation 8 rows x 4 columns in registers. 16 k at a
// time are staged in workgroup memory, x transposed: half of the invocations load 4 rows x 4 k each, the other half
// 4 k x 4 columns of w. Sums run over k in order. Needs a depth and a number of columns that are multiples of 4.
// HALF keeps the tiles as f16 (x rounded, above 65,504 to infinity; w exactly as stored); sums are f32.
//
// Roofline, a workgroup and 16 k: 2 * 64 * 64 * 16 = 131,072 flop for 64 * 16 * 4 bytes of x and as many of w (half and a
// quarter with f16 and int8 weights): 16 flop a byte from L2 (21 and 26), so 2 TB/s of L2 feed 32 TFLOP/s. Workgroup
// memory: 3 vec4 a k for 32 multiply-adds an invocation; of the 48 bytes neighbours share all but 10 (16 read the same
// rows, 8 the same columns), so a unit that delivers 128 bytes a clock keeps 128 lanes of multiply-adds half busy.
// HALF halves those bytes and costs 12 conversions, which are free or cheap on Apple, AMD and Arm, and a third of the time on
// Nvidia; that family has cooperative matrices (tile_cooperative), which come first.
// Occupancy: 32 sums, 12 operands, about 20 of indices: 64 registers, 1024 invocations a 64 K-register unit; 8 KiB of
// workgroup memory (4 with HALF) leave room for the same 8 workgroups in 64 KiB. With 8, another workgroup computes while
// one waits for memory; double buffering would take registers or memory from that and was left out. Subgroup
// operations too: a shuffle moves 4 bytes per lane and instruction, a vec4 from workgroup memory 16, through the same
// crossbar.

#if HALF
alias TileNumber4 = vec4<f16>;
#else
alias TileNumber4 = vec4<f32>;
#endif
// [k][row / 4] and [k][column / 4], 16 x 16 each.
var<workgroup> xs: array<TileNumber4, 256>;
var<workgroup> ws: array<TileNumber4, 256>;

#if HALF
fn tile_number(v: vec4<f32>) -> vec4<f16> {
    return vec4<f16>(v);
}
#else
fn tile_number(v: vec4<f32>) -> vec4<f32> {
    return v;
}
#endif

@compute @workgroup_size(128)
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups);
    let wide = (p.blocks + 1u) / 2u;
    let column0 = tile % wide * 64u;
    let first_row = tile / wide * 64u;
    // What this invocation stages: rows of x, or columns of w (vec4 `quad` of the tile), at depth `deep` of the 16.
    let loads_x = index < 64u;
    let quad = select(index % 16u, index / 4u, loads_x);
    let deep = select(index % 64u / 16u, index % 4u, loads_x) * 4u;
#for i in 0..4
    // Rows past the end read the last one; they are not written.
    let row$i = tile_row(min(first_row + quad % 16u * 4u + ${i}u, tile_rows() - 1u));
#end
    let w_block = (column0 + quad * 4u) / 32u;
#for i in 0..8
    var c$i = vec4<f32>(0.0);
#end
    let x4 = index / 16u * 2u;
    let w4 = index % 16u;
    for (var k0 = 0u; k0 < tile_depth(); k0 += 16u) {
        let k = k0 + deep;
        let at = deep * 16u + quad;
        if (loads_x) {
            let part = transpose(mat4x4<f32>(tile_x(row0, k), tile_x(row1, k), tile_x(row2, k), tile_x(row3, k)));
#for j in 0..4
            xs[at + ${j*16}u] = tile_number(part[$j]);
#end
        } else {
            var part = mat4x4<f32>();
            if (k < tile_depth() && w_block < p.blocks) {
                part = lib_weight4(w_block, k, quad % 8u);
            }
#for j in 0..4
            ws[at + ${j*16}u] = tile_number(part[$j]);
#end
        }
        workgroupBarrier();
        for (var step = 0u; step < 16u; step++) {
            let a = vec4<f32>(xs[step * 16u + x4]);
            let b = vec4<f32>(xs[step * 16u + x4 + 1u]);
            let w = vec4<f32>(ws[step * 16u + w4]);
#for i in 0..4
            c$i = fma(vec4<f32>(a[$i]), w, c$i);
            c${i+4} = fma(vec4<f32>(b[$i]), w, c${i+4});
#end
        }
        workgroupBarrier();
    }
#for i in 0..8
    finish(c$i, first_row + x4 * 4u + ${i}u, p.n0 + column0 + w4 * 4u);
#end
}
