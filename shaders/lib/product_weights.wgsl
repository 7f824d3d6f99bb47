// Weights of four k (b0..b3, a vec4 of columns each) from packed weights at `wpos`, which moves on; pasted.
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
