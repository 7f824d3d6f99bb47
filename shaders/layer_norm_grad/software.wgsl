// layer_norm_grad, rows, software devices: see lib/layer_norm_grad_params for the equations and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $ROWS consecutive rows at once; lane l takes the eights l, l + 8, .. of each. A
// first walk takes mean and squares as `layer_norm` does (eight numbers at a time joined to what a lane has, the lanes joined by
// constant shuffles), a second the two sums of gradients, a third writes. Needs c to be a multiple of 8.
#import layer_norm_grad_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Wide>;
@group(0) @binding(2) var<storage, read> weight: array<Wide>;
@group(0) @binding(3) var<storage, read> dy: array<Wide>;
@group(0) @binding(4) var<storage, read_write> dx: array<Wide>;
@group(0) @binding(5) var<storage, read_write> stats: array<vec2<f32>>;

// The sum over all 8 lanes, the same bits in every lane.
fn total(v: f32) -> f32 {
    var s = v;
    s += subgroupShuffleXor(s, 1u);
    s += subgroupShuffleXor(s, 2u);
    s += subgroupShuffleXor(s, 4u);
    return s;
}

fn sum4(v: vec4<f32>) -> f32 {
    return (v.x + v.y) + (v.z + v.w);
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
            let middle = sum4(v[0] + v[1]) * 0.125;
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
    var plain$r = 0.0;
    var along$r = 0.0;
#end
    let weighted = (p.flags & HAS_WEIGHT) != 0u;
    for (var i = lane; i < c8; i += 8u) {
        // Without weights this reads the buffer for absent arguments; a branch would cost more.
        let w_at = lib_wide(weight[i]);
#for h in 0..2
        let w$h = select(vec4<f32>(1.0), w_at[$h], weighted);
#end
#for r in 0..$ROWS
        {
            let v = lib_wide(x[x$r + i]);
            let d = lib_wide(dy[x$r + i]);
            let g = d[0] * w0;
            let h = d[1] * w1;
            plain$r += sum4(g + h);
            along$r += dot(g, (v[0] - vec4<f32>(row_mean$r)) * scale$r) + dot(h, (v[1] - vec4<f32>(row_mean$r)) * scale$r);
        }
#end
    }
#for r in 0..$ROWS
    let row_plain$r = total(plain$r) * inverse;
    let row_along$r = total(along$r) * inverse;
#end
    for (var i = lane; i < c8; i += 8u) {
        let w_at = lib_wide(weight[i]);
#for h in 0..2
        let w$h = select(vec4<f32>(1.0), w_at[$h], weighted);
#end
#for r in 0..$ROWS
        let in$r = lib_wide(x[x$r + i]);
        let d$r = lib_wide(dy[x$r + i]);
#for h in 0..2
        let v${r}_$h = ((d$r[$h] * w$h - vec4<f32>(row_plain$r)) - (in$r[$h] - vec4<f32>(row_mean$r)) * scale$r * row_along$r) * scale$r;
#end
#end
#for r in 0..$ROWS
        dx[x$r + i] = lib_to_wide(v${r}_0, v${r}_1);
#end
    }
#for r in 0..$ROWS
    if (lane == ${r}u && row0 + ${r}u < p.m) {
        stats[row0 + ${r}u] = vec2<f32>(row_mean$r, scale$r);
    }
#end
}
