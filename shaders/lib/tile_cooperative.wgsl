// As tile_product, with cooperative matrices: pasted after the same declarations.
//
// A workgroup of 128 owns 64 rows x 64 columns in four quadrants of 32 x 32, a subgroup one quadrant, as $T x $T sums. Any
// number of subgroups will do: with 32 lanes there are four and all is done in one pass; with 64 lanes two passes stage
// everything twice; with 16 or fewer the surplus subgroups repeat the last quadrant and their results are dropped,
// because cooperative operations must be reached by all. $KS k are staged at a time. A sum is one chain over steps of
// $T k in order; the order within a step is the device's.
//
// Roofline: 2 * 64 * 64 flop a k, as tile_product 16 flop a byte from L2 with f32 weights, 21 with f16, 26 with int8. A matrix
// unit does 8 to 16 times the multiply-adds of the plain ones, so L2 bounds: 2 TB/s feed 42 TFLOP/s of f16 products. A
// quadrant reads 2 * 32 operands a k from workgroup memory for 32 * 32 multiply-adds: 8 a byte with f16 (4 with f32), 1024
// a clock for the 128 bytes a unit delivers, what its matrix unit takes. Larger tiles would need more workgroup memory
// than WebGPU promises. Occupancy: 1024 sums a subgroup, 32 registers at 32 lanes, 96 in all; workgroup memory 12 KiB with
// f16 and 16 x 16, 9.25 KiB with f32 and 8 x 8: 5 to 7 workgroups in 64 KiB.
#import cooperative

// [row][k], [k][column]; the results of four quadrants, and of surplus subgroups.
var<workgroup> xs: array<CoopNumber, ${KS*64}>;
var<workgroup> ws: array<CoopNumber, ${KS*64}>;
var<workgroup> cs: array<f32, ${T*T*5}>;

fn tile_number(v: vec4<f32>) -> vec4<CoopNumber> {
    return vec4<CoopNumber>(v);
}

@compute @workgroup_size(128)
fn main(
    @builtin(local_invocation_index) index: u32,
#if !LANES
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
#endif
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
#if LANES
    let subgroup = index / ${LANES}u;
    let subgroups = ${128/LANES}u;
    coop_lane = index % ${LANES}u;
#endif
    let tile = lib_fold(group, groups);
    let wide = (p.blocks + 1u) / 2u;
    let column0 = tile % wide * 64u;
    let first_row = tile / wide * 64u;
    // Each invocation stages 4 k of ${KS/8} rows of x, ${512/KS} rows apart, and 4 k x 4 columns of w.
    let x_row = index / ${KS/4}u;
    let x_k = index % ${KS/4}u * 4u;
#for i in 0..${KS/8}
    // Rows past the end read the last one; they are not written.
    let row$i = tile_row(min(first_row + x_row + ${512/KS*i}u, tile_rows() - 1u));
#end
    let w_quad = index % 16u;
    let w_k = index / 16u * 4u;
    let w_block = (column0 + w_quad * 4u) / 32u;
    for (var turn = 0u; turn < 4u; turn += subgroups) {
        let quadrant = min(turn + subgroup, 3u);
        let slot = min(turn + subgroup, 4u);
#for i in 0..${32/T}
#for j in 0..${32/T}
        var c${i}_$j = coop_zero();
#end
#end
        for (var k0 = 0u; k0 < tile_depth(); k0 += ${KS}u) {
#for i in 0..${KS/8}
            {
                let part = tile_number(tile_x(row$i, k0 + x_k));
                let at = (x_row + ${512/KS*i}u) * ${KS}u + x_k;
#for j in 0..4
                xs[at + ${j}u] = part[$j];
#end
            }
#end
            if (w_k < ${KS}u) {
                var part = mat4x4<f32>();
                if (k0 + w_k < tile_depth() && w_block < p.blocks) {
                    part = lib_weight4(w_block, k0 + w_k, w_quad % 8u);
                }
#for i in 0..4
                {
                    let row = tile_number(part[$i]);
#for j in 0..4
                    ws[(w_k + ${i}u) * 64u + w_quad * 4u + ${j}u] = row[$j];
#end
                }
#end
            }
            workgroupBarrier();
            for (var k = 0u; k < ${KS}u; k += ${T}u) {
#for i in 0..${32/T}
                let a$i = coop_a((quadrant / 2u * 32u + ${i*T}u) * ${KS}u + k, ${KS}u);
#end
#for j in 0..${32/T}
                let b$j = coop_b(k * 64u + quadrant % 2u * 32u + ${j*T}u, 64u);
#for i in 0..${32/T}
                c${i}_$j = coop_fma(a$i, b$j, c${i}_$j);
#end
#end
            }
            workgroupBarrier();
        }
        // The same tile of each quadrant of this pass goes through workgroup memory, four columns per invocation at a time.
        let done = min(4u - turn, subgroups);
#for i in 0..${32/T}
#for j in 0..${32/T}
        coop_store(c${i}_$j, slot * ${T*T}u);
        workgroupBarrier();
        for (var n = index; n < done * ${T*T/4}u; n += 128u) {
            let q = turn + n / ${T*T/4}u;
            let row = n % ${T*T/4}u / ${T/4}u;
            let column = n % ${T/4}u * 4u;
            let at = q * ${T*T}u + row * ${T}u + column;
            finish(
                vec4<f32>(cs[at], cs[at + 1u], cs[at + 2u], cs[at + 3u]),
                first_row + q / 2u * 32u + ${i*T}u + row,
                p.n0 + column0 + q % 2u * 32u + ${j*T}u + column);
        }
        workgroupBarrier();
#end
#end
    }
}
