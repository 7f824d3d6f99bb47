// Four rows of an outer product, pasted into a loop over them: of each, 32 numbers of dy times 32 of x, of which a lane holds a
// vec4 of each (d0.. and b0.., a row each), into the sums c0... In lane l, sum 8 i + j belongs to number 4 (j ^ l) + i of dy: it reaches the
// lane by an exclusive-or shuffle, as in lib/product_step, and all rows of a sum follow one another for the reason given there.
#for i in 0..4
#for j in 0..8
#for q in 0..4
        c${i*8+j} = fma(vec4<f32>(subgroupShuffleXor(d$q[$i], ${j}u)), b$q, c${i*8+j});
#end
#end
#end
