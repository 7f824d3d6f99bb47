// winograd_weights, the gradient's pass: dM = A dY At for each tile and channel, where y = At M A; see lib/winograd_params.
//
// An invocation owns a tile (4x4 pixels, those outside of the map are 0) and 4 channels.
#import winograd_params
#import grid

@group(0) @binding(1) var<storage, read> dy: array<Quad>;
@group(0) @binding(2) var<storage, read_write> m: array<Quad>;

struct Six {
#for i in 0..6
    v$i: vec4<f32>,
#end
}

// A times a column of four: powers of the points.
fn a(y0: vec4<f32>, y1: vec4<f32>, y2: vec4<f32>, y3: vec4<f32>) -> Six {
    let even = y0 + 0.5625 * y2;
    let odd = 0.75 * y1 + 0.421875 * y3;
    let even2 = y0 + 2.25 * y2;
    let odd2 = 1.5 * y1 + 3.375 * y3;
    return Six(y0, even + odd, even - odd, even2 + odd2, even2 - odd2, y3);
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
    let at = lib_tile(p.tile0 + row);
    let none = vec4<f32>(0.0);
    // Rows and columns outside of the map read its edge, and count as zero.
#for i in 0..4
    let row$i = (at.x * p.ho + min(at.y + ${i}u, p.ho - 1u)) * p.wo;
#end
#for j in 0..4
    let column$j = min(at.z + ${j}u, p.wo - 1u);
#for i in 0..4
    let d$i$j = select(none, lib_quad(dy[p.y_rest / 4u + (row$i + column$j) * width + n4]), at.y + ${i}u < p.ho && at.z + ${j}u < p.wo);
#end
    let t$j = a(d0$j, d1$j, d2$j, d3$j);
#end
    var to = row * width + n4;
    let place = p.stride * width;
#for i in 0..6
    let r$i = a(t0.v$i, t1.v$i, t2.v$i, t3.v$i);
#for j in 0..6
    m[to] = lib_to_quad(r$i.v$j);
    to += place;
#end
#end
}
