// linear_weights, software devices: see lib/linear_weights_params for the equation, the shapes and the order of the sums.
//
// A workgroup is one subgroup of 8 lanes and owns 32 columns of dy x 32 of x of one section; a lane loads four
// neighbouring numbers of each (one vec4), four rows at a time (lib/outer_step). No workgroup memory, no barrier. Needs n and k to be
// multiples of 4.
#import linear_weights_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<storage, read> dy: array<Quad>;
@group(0) @binding(3) var<storage, read_write> out: array<Quad>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let index = lib_fold(group, groups);
    let tiles = p.n_tiles * p.k_tiles;
    let section = index / tiles;
    let tile = index - section * tiles;
    let n = p.n0 + tile / p.k_tiles * 32u;
    let k4 = tile % p.k_tiles * 8u + lane;
    let first = section * p.section;
    if (first >= p.m) {
        return;
    }
    let rows = min(p.section, p.m - first);
    let dy_pitch = p.n / 4u;
    let x_pitch = p.k / 4u;
    // Columns past the end read the last four; they are not written.
    var dy_at = first * dy_pitch + min(n / 4u + lane, dy_pitch - 1u);
    var x_at = first * x_pitch + min(k4, x_pitch - 1u);
    // Where sum i of this lane goes: number 4 ((i % 8) ^ lane) + i / 8 of the tile.
    let to = (p.out_rest + section * p.out_step) / 4u + k4;
    // An array, so that loops fill, add to and empty it: unrolled, that code is larger than what it is for.
    var t: array<vec4<f32>, 32>;
    for (var i = 0u; i < 32u; i++) {
        let row = n + ((i % 8u) ^ lane) * 4u + i / 8u;
        t[i] = vec4<f32>(0.0);
        if ((p.flags & GO_ON) != 0u && row < p.n1 && k4 < x_pitch) {
            t[i] = lib_quad(out[to + (row - p.n0) * x_pitch]);
        }
    }
    for (var part = 0u; part < rows; part += PART) {
#for i in 0..32
        var c$i = vec4<f32>(0.0);
#end
        let count = min(rows - part, PART);
        for (var row = 0u; row < count / 4u; row++) {
#for q in 0..4
            let d$q = lib_quad(dy[dy_at + ${q}u * dy_pitch]);
            let b$q = lib_quad(x[x_at + ${q}u * x_pitch]);
#end
            dy_at += 4u * dy_pitch;
            x_at += 4u * x_pitch;
#import outer_step
        }
        for (var row = count / 4u * 4u; row < count; row++) {
            let d = lib_quad(dy[dy_at]);
            let b = lib_quad(x[x_at]);
            dy_at += dy_pitch;
            x_at += x_pitch;
#for i in 0..4
#for j in 0..8
            c${i*8+j} = fma(vec4<f32>(subgroupShuffleXor(d[$i], ${j}u)), b, c${i*8+j});
#end
#end
        }
#for i in 0..32
        t[$i] += c$i;
#end
    }
    for (var i = 0u; i < 32u; i++) {
        let row = n + ((i % 8u) ^ lane) * 4u + i / 8u;
        if (row < p.n1 && k4 < x_pitch) {
            out[to + (row - p.n0) * x_pitch] = lib_to_quad(t[i]);
        }
    }
}
