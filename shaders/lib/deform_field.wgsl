// Sampling a plain field [levels, times, hp * wp, 9] for pixel i of the dispatch (see deform_params): the importer
// binds `offsets`, `weights` and `field`.
#import deform_params
#import motion

// The nine blended channels at time t.
fn lib_sample(i: u32, reference: vec2<f32>, t: u32) -> LibMotion {
    var sum = LibMotion(vec3<f32>(0.0), vec3<f32>(0.0), vec3<f32>(0.0));
    let all = p.levels * p.points;
    let cells = p.hp * p.wp;
    var o = p.o_rest + i * all * 2u;
    var w = p.w_rest + i * all;
    var base = t * cells;
    for (var l = 0u; l < p.levels; l++) {
        for (var j = 0u; j < p.points; j++) {
            let taps = lib_taps(reference, vec2<f32>(offsets[o], offsets[o + 1u]), weights[w]);
            o += 2u;
            w += 1u;
#for c in 0..4
            {
                let at = (base + taps.cell[$c]) * 9u;
                let weight = vec3<f32>(taps.weight[$c]);
                sum.a = fma(weight, vec3<f32>(field[at], field[at + 1u], field[at + 2u]), sum.a);
                sum.b = fma(weight, vec3<f32>(field[at + 3u], field[at + 4u], field[at + 5u]), sum.b);
                sum.c = fma(weight, vec3<f32>(field[at + 6u], field[at + 7u], field[at + 8u]), sum.c);
            }
#end
        }
        base += p.times * cells;
    }
    return sum;
}
