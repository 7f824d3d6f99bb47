// layer_norm, software devices: see lib/layer_norm_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $ROWS consecutive rows at once; lane l takes the vec4 l, l + 8, … of
// each. Loads cost more than anything else, so x is read twice and weight and bias once for all rows: a lane keeps the
// mean of what it has read and the sum of squares around it, and joins four numbers at a time to them (Chan, Golub,
// LeVeque 1983, which is as exact as two passes); three constant shuffles join the lanes. No workgroup memory, no
// barrier. Needs c to be a multiple of 4. ACT is a variant of its own because both sides of a branch are computed here.
#import layer_norm_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<storage, read> weight: array<Quad>;
@group(0) @binding(3) var<storage, read> bias: array<Quad>;
@group(0) @binding(4) var<storage, read_write> y: array<Quad>;

// The sum over all 8 lanes, the same bits in every lane.
fn total(v: f32) -> f32 {
    var s = v;
    s += subgroupShuffleXor(s, 1u);
    s += subgroupShuffleXor(s, 2u);
    s += subgroupShuffleXor(s, 4u);
    return s;
}

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let row0 = lib_fold(group, groups) * ${ROWS}u;
    if (row0 >= p.m) {
        return;
    }
    let c4 = p.c / 4u;
    let inverse = 1.0 / f32(p.c);
#for r in 0..$ROWS
    // Rows past the end read the last row; they are not written.
    let x$r = min(row0 + ${r}u, p.m - 1u) * c4;
    var mean$r = 0.0;
    var squares$r = 0.0;
#end
    var count = 0.0;
    for (var i = lane; i < c4; i += 8u) {
        let before = count;
        count += 4.0;
        let share = 4.0 / count;
        let cross = before * share;
#for r in 0..$ROWS
        {
            let v = lib_quad(x[x$r + i]);
            let middle = ((v.x + v.y) + (v.z + v.w)) * 0.25;
            let d = v - vec4<f32>(middle);
            let apart = middle - mean$r;
            mean$r = fma(apart, share, mean$r);
            squares$r += fma(apart * apart, cross, dot(d, d));
        }
#end
    }
#for r in 0..$ROWS
    let row_mean$r = total(mean$r * count) * inverse;
    let off$r = mean$r - row_mean$r;
    let scale$r = 1.0 / sqrt(total(fma(off$r * off$r, count, squares$r)) * inverse + p.eps);
#end
    for (var i = lane; i < c4; i += 8u) {
        var w = vec4<f32>(1.0);
        if ((p.flags & HAS_WEIGHT) != 0u) {
            w = lib_quad(weight[i]);
        }
        var b = vec4<f32>(0.0);
        if ((p.flags & HAS_BIAS) != 0u) {
            b = lib_quad(bias[i]);
        }
#for r in 0..$ROWS
        let v$r = (lib_quad(x[x$r + i]) - vec4<f32>(row_mean$r)) * vec4<f32>(scale$r) * w + b;
#end
#for r in 0..$ROWS
        if (row0 + ${r}u < p.m) {
#if ACT
            y[x$r + i] = lib_to_quad(lib_activate(v$r, p.act));
#else
            y[x$r + i] = lib_to_quad(v$r);
#endif
        }
#end
    }
}
