// conv2d_weights, software devices: see lib/conv2d_weights_params for the equation, the shapes and the order of the sums.
//
// A workgroup is one subgroup of 8 lanes and owns 32 output channels x 32 input channels of one tap and one section; a lane
// loads four neighbouring channels of each map (one vec4), four pixels of a row at a time (lib/outer_step). No workgroup
// memory, no barrier. Needs ci and co to be multiples of 4.
#import conv2d_weights_params
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
    let section = index / (tiles * p.taps);
    let tap = index / tiles % p.taps;
    let tile = index % tiles;
    let n = tile / p.k_tiles * 32u;
    let k4 = tile % p.k_tiles * 8u + lane;
    let first = section * p.section;
    if (first >= p.rows) {
        return;
    }
    let rows = min(p.section, p.rows - first);
    let ky = tap / p.kw;
    let kx = tap - ky * p.kw;
    let columns = lib_columns(kx);
    let ci4 = p.ci / 4u;
    let co4 = p.co / 4u;
    // Channels past the end read the last four; they are not written.
    let x_lane = min(k4, ci4 - 1u);
    let dy_lane = min(n / 4u + lane, co4 - 1u);
    let x_pitch = p.stride * ci4;
    // Where sum i of this lane goes: output channel 4 ((i % 8) ^ lane) + i / 8 of the tile.
    let to = (p.out_rest + section * p.out_step) / 4u + tap * p.co * ci4 + k4;
    // An array, so that loops fill, add to and empty it: unrolled, that code is larger than what it is for.
    var t: array<vec4<f32>, 32>;
    for (var i = 0u; i < 32u; i++) {
        let o = n + ((i % 8u) ^ lane) * 4u + i / 8u;
        t[i] = vec4<f32>(0.0);
        if ((p.flags & GO_ON) != 0u && o < p.co && k4 < ci4) {
            t[i] = lib_quad(out[to + o * ci4]);
        }
    }
    for (var part = 0u; part < rows; part += p.part) {
#for i in 0..32
        var c$i = vec4<f32>(0.0);
#end
        let stop = min(part + p.part, rows);
        for (var row = part; row < stop; row++) {
            let place = lib_frame(first + row);
            let iy = lib_source(place.y, ky);
            // Rows outside of the map have no columns.
            let inside = iy >= 0 && iy < i32(p.hi);
            let count = select(0u, columns.y - min(columns.x, columns.y), inside);
            var dy_at = p.dy_rest / 4u + ((first + row) * p.wo + columns.x) * co4 + dy_lane;
            var x_at = lib_x_row(place.x, select(0, iy, inside)) / 4u + (columns.x * p.stride + kx - p.pad) * ci4 + x_lane;
            for (var column = 0u; column < count / 4u; column++) {
#for q in 0..4
                let d$q = lib_quad(dy[dy_at + ${q}u * co4]);
                let b$q = lib_quad(x[x_at + ${q}u * x_pitch]);
#end
                dy_at += 4u * co4;
                x_at += 4u * x_pitch;
#import outer_step
            }
            for (var column = count / 4u * 4u; column < count; column++) {
                let d = lib_quad(dy[dy_at]);
                let b = lib_quad(x[x_at]);
                dy_at += co4;
                x_at += x_pitch;
#for i in 0..4
#for j in 0..8
                c${i*8+j} = fma(vec4<f32>(subgroupShuffleXor(d[$i], ${j}u)), b, c${i*8+j});
#end
#end
            }
        }
#for i in 0..32
        t[$i] += c$i;
#end
    }
    for (var i = 0u; i < 32u; i++) {
        let o = n + ((i % 8u) ^ lane) * 4u + i / 8u;
        if (o < p.co && k4 < ci4) {
            out[to + o * ci4] = lib_to_quad(t[i]);
        }
    }
}
