// Four k of the software tile, pasted into the loop over k: $TM rows (a0.., one vec4 of four k a lane, 8 lanes to
// a register) times 32 columns of packed weights at `wpos`, into the sums c0... Rows reach the other lanes by
// constant shuffles.
#if W16
#for h in 0..2
        let u$h = w[wpos];
        wpos += 8u;
#for e in 0..2
#if !e
        let b${h*2+e} = lib_even(u$h);
#else
        let b${h*2+e} = lib_odd(u$h);
#endif
#for r in 0..$R
#for j in 0..8
        c${r*8+j} = fma(vec4<f32>(subgroupShuffle(a$r[${h*2+e}], ${j}u)), b${h*2+e}, c${r*8+j});
#end
#end
#end
#end
#else
#if W8
        let u = w[wpos];
        wpos += 8u;
#endif
#for q in 0..4
#if W8
        let b$q = lib_byte(u, ${q}u);
#else
        let b$q = w[wpos];
        wpos += 8u;
#endif
#for r in 0..$R
#for j in 0..8
        c${r*8+j} = fma(vec4<f32>(subgroupShuffle(a$r[$q], ${j}u)), b$q, c${r*8+j});
#end
#end
#end
#endif
