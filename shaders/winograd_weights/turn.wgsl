// winograd_weights, the last pass: dw[o, c] = Gt dU[o, c] G, from the sums dU [36, co, ci] over all tiles; see lib/winograd_params.
//
// An invocation owns an output and an input channel: 36 numbers that lie co ci apart, and nine neighbours of dw.
#import winograd_params
#import grid

@group(0) @binding(1) var<storage, read> sums: array<f32>;
@group(0) @binding(2) var<storage, read_write> dw: array<f32>;

// Gt times a column of six: G evaluates a column of three at 0, 3/4, -3/4, 3/2, -3/2 and infinity, each over the product of its distances from the
// others.
fn gt(u0: f32, u1: f32, u2: f32, u3: f32, u4: f32, u5: f32) -> vec3<f32> {
    let near = 1.0 / (2.0 * 0.5625 * (0.5625 - 2.25));
    let far = 1.0 / (2.0 * 2.25 * (2.25 - 0.5625));
    let even = near * (u1 + u2);
    let odd = near * (u1 - u2);
    let even2 = far * (u3 + u4);
    let odd2 = far * (u3 - u4);
    return vec3<f32>(
        u0 / (0.5625 * 2.25) + even + even2,
        0.75 * odd + 1.5 * odd2,
        0.5625 * even + 2.25 * even2 + u5,
    );
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local;
    let step = p.co * p.ci;
    if (index >= step) {
        return;
    }
    var at = p.x_rest + index;
#for i in 0..6
#for j in 0..6
    let u$i$j = sums[at];
    at += step;
#end
    let r$i = gt(u${i}0, u${i}1, u${i}2, u${i}3, u${i}4, u${i}5);
#end
#for c in 0..3
    let column$c = gt(r0[$c], r1[$c], r2[$c], r3[$c], r4[$c], r5[$c]);
#for r in 0..3
    dw[index * 9u + ${r*3+c}u] = column$c[$r];
#end
#end
}
