// winograd, first pass: V = Bt d B for each tile and channel; see lib/winograd_params.
//
// An invocation owns a tile and 8 channels.
#import winograd_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<Wide>;
@group(0) @binding(2) var<storage, read_write> v: array<Wide>;

struct Six {
    v0: mat2x4<f32>,
    v1: mat2x4<f32>,
    v2: mat2x4<f32>,
    v3: mat2x4<f32>,
    v4: mat2x4<f32>,
    v5: mat2x4<f32>,
}

// Bt times a column of six; coefficients of the products of all (x - point) but one.
fn bt(d0: mat2x4<f32>, d1: mat2x4<f32>, d2: mat2x4<f32>, d3: mat2x4<f32>, d4: mat2x4<f32>, d5: mat2x4<f32>) -> Six {
    let even = d4 - 2.25 * d2;
    let odd = 0.75 * (d3 - 2.25 * d1);
    let even2 = d4 - 0.5625 * d2;
    let odd2 = 1.5 * (d3 - 0.5625 * d1);
    return Six(
        1.265625 * d0 - 2.8125 * d2 + d4,
        even + odd,
        even - odd,
        even2 + odd2,
        even2 - odd2,
        1.265625 * d1 - 2.8125 * d3 + d5,
    );
}

// pre(x) of 8 channels, 0 where the map is not.
fn seen(stored: Wide, there: bool) -> mat2x4<f32> {
    let low = vec4<f32>(p.low);
    let none = vec4<f32>(0.0);
    let d = lib_wide(stored);
    return mat2x4<f32>(select(none, max(d[0], low), there), select(none, max(d[1], low), there));
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local;
    let width = p.ci / 8u;
    let row = index / width;
    if (row >= p.tiles) {
        return;
    }
    let c = index - row * width;
    let at = lib_tile(p.tile0 + row);
    // Rows and columns outside of the map read its edge, and count as zero.
#for i in 0..6
    let y$i = i32(at.y + ${i}u) - i32(p.pad);
    let row$i = (at.x * p.hi + u32(clamp(y$i, 0, i32(p.hi) - 1))) * p.wi;
    let on$i = y$i >= 0 && y$i < i32(p.hi);
#end
#for j in 0..6
    let x$j = i32(at.z + ${j}u) - i32(p.pad);
    let column$j = u32(clamp(x$j, 0, i32(p.wi) - 1));
    let in$j = x$j >= 0 && x$j < i32(p.wi);
#for i in 0..6
    let at$i$j = p.x_rest / 8u + (row$i + column$j) * width + c;
    let d$i$j = seen(x[at$i$j], on$i && in$j);
#end
    let t$j = bt(d0$j, d1$j, d2$j, d3$j, d4$j, d5$j);
#end
    var to = row * width + c;
    let place = p.stride * width;
#for i in 0..6
    let r$i = bt(t0.v$i, t1.v$i, t2.v$i, t3.v$i, t4.v$i, t5.v$i);
#for j in 0..6
    v[to] = lib_to_wide(r$i.v$j[0], r$i.v$j[1]);
    to += place;
#end
#end
}
