// Four k of the software tile, pasted into the loop over k: $TM rows (a0.., one vec4 of four k a lane, 8 lanes to
// a register) times 32 columns of packed weights at `wpos`, into the sums c0... In lane l, sum i belongs to row i ^ l (of
// the same 8): x reaches it by exclusive-or shuffles, one permutation within half a register where a broadcast takes two.
//
// All four k of a row follow one another: the driver's compiler keeps to the order of the text, and with k outermost it made
// the products of all rows first and spilled them (benches/log/2026-11-28-compiled-code.md).
#import product_weights
#for r in 0..$R
#for j in 0..8
#for q in 0..4
        c${r*8+j} = fma(vec4<f32>(subgroupShuffleXor(a$r[$q], ${j}u)), b$q, c${r*8+j});
#end
#end
#end
