// winograd, third pass: y = At M A with bias, activation and residuals; see lib/winograd_params.
//
// An invocation owns a tile (2x2 pixels) and 4 channels.
#import winograd_params
#import conv2d_epilogue
#import grid

@group(0) @binding(1) var<storage, read> bias: array<Quad>;
@group(0) @binding(2) var<storage, read> residual: array<Quad>;
@group(0) @binding(3) var<storage, read> residual2: array<Quad>;
@group(0) @binding(4) var<storage, read_write> y: array<Quad>;
@group(0) @binding(5) var<storage, read_write> m: array<Quad>;

fn finish(sum: vec4<f32>, at: vec3<u32>, n4: u32, added: vec4<f32>) {
    if (at.y >= p.ho || at.z >= p.wo) {
        return;
    }
    lib_finish(sum, p.y_rest / 4u + ((at.x * p.ho + at.y) * p.wo + at.z) * (p.co / 4u) + n4, added);
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
#for i in 0..4
#for j in 0..4
    let m$i$j = lib_quad(m[start + ${j}u * place]);
#end
    let s${i}0 = m${i}0 + m${i}1 + m${i}2;
    let s${i}1 = m${i}1 - m${i}2 - m${i}3;
    start += 4u * place;
#end
    let added = lib_bias(n4);
    let at = lib_tile(p.tile0 + row);
#for j in 0..2
    finish(s0$j + s1$j + s2$j, at + vec3<u32>(0u, 0u, ${j}u), n4, added);
    finish(s1$j - s2$j - s3$j, at + vec3<u32>(0u, 1u, ${j}u), n4, added);
#end
}
