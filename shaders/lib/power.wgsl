// v to the power s of numbers from 0 on. The power of 0 is chosen, since drivers approximate its logarithm.
fn lib_power(v: vec4<f32>, s: f32) -> vec4<f32> {
    let at_zero = select(1.0 / v, vec4<f32>(0.0), s > 0.0);
    return select(select(pow(v, vec4<f32>(s)), at_zero, v == vec4<f32>(0.0)), vec4<f32>(1.0), s == 0.0);
}
