// The outer product of `linear_weights` and `conv2d_weights` on GPUs, pasted after what the importer says of its rows:
// `outer_dy(row, column)` and `outer_x(row, column)`, four numbers of a row, and `outer_at(section, n, k)`, the place of
// four sums in `out`.
//
// A workgroup of 128 owns 64 columns of dy x 64 of x of one section, an invocation 8 x 4 sums in registers. 16 rows at a
// time are staged in workgroup memory as they lie. A part of `part` rows is summed in order, then joined to the section's sums.
//
// Roofline, 16 rows: 2 * 64 * 64 * 16 = 131,072 flop for 2 * 64 * 16 * 4 bytes, 16 flop a byte from L2, as lib/tile_product, whose
// counts of workgroup memory reads hold here too. Occupancy: 64 sums, 12 operands, about 20 of indices, 96 registers: 640 invocations a
// 64 K-register unit; 8 KiB of workgroup memory. The second 32 sums cost occupancy and save 32 KiB of traffic a part.

// [row][column / 4], 16 x 16 each.
var<workgroup> ds: array<vec4<f32>, 256>;
var<workgroup> xs: array<vec4<f32>, 256>;

// Sums of the section's rows `first .. end` (of the dispatch) for the columns from column_n of dy and from column_k of x.
fn outer_tile(index: u32, section: u32, first: u32, end: u32, part: u32, column_n: u32, column_k: u32, go_on: bool) {
    let n8 = index / 16u * 2u;
    let k4 = index % 16u;
#for i in 0..8
    let n$i = column_n + n8 * 4u + ${i}u;
    let mine$i = n$i < outer_n() && column_k + k4 * 4u < outer_k();
    var t$i = vec4<f32>(0.0);
    if (go_on && mine$i) {
        t$i = out[outer_at(section, n$i, column_k + k4 * 4u)];
    }
#end
    for (var start = first; start < end; start += part) {
        let to = min(start + part, end);
#for i in 0..8
        var c$i = vec4<f32>(0.0);
#end
        for (var row = start; row < to; row += 16u) {
            for (var at = index; at < 256u; at += 128u) {
                let mine = row + at / 16u;
                let column = at % 16u * 4u;
                var d = vec4<f32>(0.0);
                var v = vec4<f32>(0.0);
                if (mine < to && column_n + column < outer_n()) {
                    d = outer_dy(mine, column_n + column);
                }
                if (mine < to && column_k + column < outer_k()) {
                    v = outer_x(mine, column_k + column);
                }
                ds[at] = d;
                xs[at] = v;
            }
            workgroupBarrier();
            // Rows past the part's end are not added: 0 times infinity would be NaN.
            let rows = min(to - row, 16u);
            for (var step = 0u; step < rows; step++) {
                let a = ds[step * 16u + n8];
                let b = ds[step * 16u + n8 + 1u];
                let v = xs[step * 16u + k4];
#for i in 0..4
                c$i = fma(vec4<f32>(a[$i]), v, c$i);
                c${i+4} = fma(vec4<f32>(b[$i]), v, c${i+4});
#end
            }
            workgroupBarrier();
        }
#for i in 0..8
        t$i += c$i;
#end
    }
#for i in 0..8
    if (mine$i) {
        out[outer_at(section, n$i, column_k + k4 * 4u)] = t$i;
    }
#end
}
