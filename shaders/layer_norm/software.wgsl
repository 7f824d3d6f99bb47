// layer_norm, software devices: see lib/layer_norm_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $ROWS consecutive rows at once; lane l takes the eights l, l + 8, … of
// each. Loads cost more than anything else, so x is read twice and weight and bias once for all rows: a lane keeps the
// mean of what it has read and the sum of squares around it, and joins eight numbers at a time to them (Chan, Golub,
// LeVeque 1983, which is as exact as two passes); three constant shuffles join the lanes. No workgroup memory, no
// barrier. Needs c to be a multiple of 8. ACT is a variant of its own because both sides of a branch are computed here.
#import layer_norm_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Wide>;
@group(0) @binding(2) var<storage, read> weight: array<Wide>;
@group(0) @binding(3) var<storage, read> bias: array<Wide>;
@group(0) @binding(4) var<storage, read_write> y: array<Wide>;

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
    let c8 = p.c / 8u;
    let inverse = 1.0 / f32(p.c);
#for r in 0..$ROWS
    // Rows past the end are the last row, and write the same once more.
    let x$r = min(row0 + ${r}u, p.m - 1u) * c8;
    var mean$r = 0.0;
    var squares$r = 0.0;
#end
    var count = 0.0;
    for (var i = lane; i < c8; i += 8u) {
        let before = count;
        count += 8.0;
        let share = 8.0 / count;
        let cross = before * share;
#for r in 0..$ROWS
        {
            let v = lib_wide(x[x$r + i]);
            let pairs = v[0] + v[1];
            let middle = ((pairs.x + pairs.y) + (pairs.z + pairs.w)) * 0.125;
            let d = v[0] - vec4<f32>(middle);
            let e = v[1] - vec4<f32>(middle);
            let apart = middle - mean$r;
            mean$r = fma(apart, share, mean$r);
            squares$r += fma(apart * apart, cross, dot(d, d) + dot(e, e));
        }
#end
    }
#for r in 0..$ROWS
    let row_mean$r = total(mean$r * count) * inverse;
    let off$r = mean$r - row_mean$r;
    let scale$r = 1.0 / sqrt(total(fma(off$r * off$r, count, squares$r)) * inverse + p.eps);
#end
    let weighted = (p.flags & HAS_WEIGHT) != 0u;
    let biased = (p.flags & HAS_BIAS) != 0u;
    for (var i = lane; i < c8; i += 8u) {
        // Without them this reads the buffer for absent arguments; a branch would cost more.
        let w_at = lib_wide(weight[i]);
        let b_at = lib_wide(bias[i]);
#for h in 0..2
        let w$h = select(vec4<f32>(1.0), w_at[$h], weighted);
        let b$h = select(vec4<f32>(), b_at[$h], biased);
#end
#for r in 0..$ROWS
        let in$r = lib_wide(x[x$r + i]);
#for h in 0..2
        let v${r}_$h = (in$r[$h] - vec4<f32>(row_mean$r)) * vec4<f32>(scale$r) * w$h + b$h;
#end
#end
#for r in 0..$ROWS
#if ACT
        y[x$r + i] = lib_to_wide(lib_activate(v${r}_0, p.act), lib_activate(v${r}_1, p.act));
#else
        y[x$r + i] = lib_to_wide(v${r}_0, v${r}_1);
#endif
#end
    }
}
