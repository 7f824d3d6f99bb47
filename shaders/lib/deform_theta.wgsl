// The motion score of pixel i of the dispatch: its blended mask (see deform_params). The importer binds `offsets`,
// `weights` and `mask`.
#import deform_params

// The blended mask, the pixel's motion score.
fn lib_theta(i: u32, reference: vec2<f32>) -> f32 {
    var sum = 0.0;
    let all = p.levels * p.points;
    for (var j = 0u; j < all; j++) {
        let o = p.o_rest + (i * all + j) * 2u;
        let taps = lib_taps(reference, vec2<f32>(offsets[o], offsets[o + 1u]), weights[p.w_rest + i * all + j]);
#for c in 0..4
        sum = fma(taps.weight[$c], mask[taps.cell[$c]], sum);
#end
    }
    return sum;
}
