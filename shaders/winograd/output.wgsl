// winograd, third pass: y = At M A with bias, activation and residuals; see lib/winograd_params.
//
// An invocation owns a tile (4x4 pixels) and 4 channels.
#import winograd_params
#import conv2d_flags
#import grid

@group(0) @binding(1) var<storage, read> bias: array<Quad>;
@group(0) @binding(2) var<storage, read> residual: array<Quad>;
@group(0) @binding(3) var<storage, read> residual2: array<Quad>;
@group(0) @binding(4) var<storage, read_write> y: array<Quad>;
@group(0) @binding(5) var<storage, read_write> m: array<Quad>;

struct Four {
    v0: vec4<f32>,
    v1: vec4<f32>,
    v2: vec4<f32>,
    v3: vec4<f32>,
}

// At times a column of six: powers of the points.
fn at(m0: vec4<f32>, m1: vec4<f32>, m2: vec4<f32>, m3: vec4<f32>, m4: vec4<f32>, m5: vec4<f32>) -> Four {
    let even = m1 + m2;
    let odd = m1 - m2;
    let even2 = m3 + m4;
    let odd2 = m3 - m4;
    return Four(
        m0 + even + even2,
        0.75 * odd + 1.5 * odd2,
        0.5625 * even + 2.25 * even2,
        0.421875 * odd + 3.375 * odd2 + m5,
    );
}

fn finish(sum: vec4<f32>, at: vec3<u32>, n4: u32, added: vec4<f32>) {
    if (at.z >= p.wo) {
        return;
    }
    let to = p.y_rest / 4u + ((at.x * p.ho + at.y) * p.wo + at.z) * (p.co / 4u) + n4;
    let floor = vec4<f32>(p.floor);
    var v = max(sum + added, floor);
    if ((p.flags & HAS_RESIDUAL) != 0u) {
        v += lib_quad(residual[to]);
    }
    if ((p.flags & HAS_RESIDUAL2) != 0u) {
        v += lib_quad(residual2[to]);
    }
    y[to] = lib_to_quad(v);
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local;
    let width = p.co / 4u;
    let row = index / width;
    if (row >= p.tiles) {
        return;
    }
    let n4 = index - row * width;
    let place = p.stride * width;
    var start = row * width + n4;
#for i in 0..6
#for j in 0..6
    let m$i$j = lib_quad(m[start]);
    start += place;
#end
    let s$i = at(m${i}0, m${i}1, m${i}2, m${i}3, m${i}4, m${i}5);
#end
    var added = vec4<f32>();
    if ((p.flags & HAS_BIAS) != 0u) {
        added = lib_quad(bias[n4]);
    }
    let first = lib_tile(p.tile0 + row);
    // A loop over the rows of the tile, whose end the driver's compiler cannot see: unrolled it takes 2 s to compile. Row i has the
    // i-th powers of the points.
    var near = 1.0;
    var far = 1.0;
    var sign = 1.0;
    let end = min(first.y + 4u, p.ho);
    for (var row_y = first.y; row_y < end; row_y++) {
        let zero = f32(row_y == first.y);
        let infinity = f32(row_y == first.y + 3u);
#for j in 0..4
        let y$j = zero * s0.v$j + near * (s1.v$j + sign * s2.v$j) + far * (s3.v$j + sign * s4.v$j) + infinity * s5.v$j;
#end
#for j in 0..4
        finish(y$j, vec3<u32>(first.x, row_y, first.z + ${j}u), n4, added);
#end
        near *= 0.75;
        far *= 1.5;
        sign = -sign;
    }
}
