// Four k of the software tile, pasted into the loop over k: $TM rows (a0.., one vec4 of four k a lane, 8 lanes to
// a register) times 32 columns of packed weights at `wpos`, into the sums c0... In lane l, sum i belongs to row i ^ l (of
// the same 8): x reaches it by exclusive-or shuffles, one permutation within half a register where a broadcast takes two.
//
// All four k of a row follow one another: the driver's compiler keeps to the order of the text, and with k outermost it made
// the products of all rows first and spilled them (BENCHMARKS.md, "what the compiled code does").
#if W16
#for h in 0..2
        let u$h = lib_quad_bits(w[wpos + ${h*8}u]);
        let b${h*2} = lib_even(u$h);
        let b${h*2+1} = lib_odd(u$h);
#end
        wpos += 16u;
#else
#if W8
        let u = lib_quad_bits(w[wpos]);
        wpos += 8u;
#for q in 0..4
        let b$q = lib_byte(u, ${q}u);
#end
#else
#for q in 0..4
        let b$q = lib_quad(w[wpos + ${q*8}u]);
#end
        wpos += 32u;
#endif
#endif
#for r in 0..$R
#for j in 0..8
#for q in 0..4
        c${r*8+j} = fma(vec4<f32>(subgroupShuffleXor(a$r[$q], ${j}u)), b$q, c${r*8+j});
#end
#end
#end
