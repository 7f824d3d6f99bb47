// conv2d_weights, any WebGPU device: see lib/conv2d_weights_params for the equation, the shapes and the order of the sums.
//
// An invocation owns 4 output channels x 4 input channels of one tap and one section; both maps are read one number at a time so
// that every number of channels is allowed.
#import conv2d_weights_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> dy: array<f32>;
@group(0) @binding(3) var<storage, read_write> out: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let tiles = p.n_tiles * p.k_tiles;
    let section = index / (tiles * p.taps);
    let tap = index / tiles % p.taps;
    let n = index % tiles / p.k_tiles * 4u;
    let k = index % p.k_tiles * 4u;
    let first = section * p.section;
    if (first >= p.rows) {
        return;
    }
    let end = min(first + p.section, p.rows);
    let ky = tap / p.kw;
    let kx = tap - ky * p.kw;
    let columns = lib_columns(kx);
    // Channels past the end read the last one; they are not written.
    let ks = min(vec4<u32>(k) + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(p.ci - 1u));
    let to = p.out_rest + section * p.out_step + (tap * p.co + n) * p.ci + k;
#for i in 0..4
    let n$i = min(n + ${i}u, p.co - 1u);
    var t$i = vec4<f32>(0.0);
#end
    if ((p.flags & GO_ON) != 0u) {
#for i in 0..4
        for (var j = 0u; j < 4u; j++) {
            if (n + ${i}u < p.co && k + j < p.ci) {
                t$i[j] = out[to + ${i}u * p.ci + j];
            }
        }
#end
    }
    for (var part = first; part < end; part += p.part) {
#for i in 0..4
        var c$i = vec4<f32>(0.0);
#end
        let stop = min(part + p.part, end);
        for (var row = part; row < stop; row++) {
            let place = lib_frame(row);
            let iy = lib_source(place.y, ky);
            if (iy >= 0 && iy < i32(p.hi)) {
                let x_row = lib_x_row(place.x, iy);
                for (var ox = columns.x; ox < columns.y; ox++) {
                    let at = x_row + (ox * p.stride + kx - p.pad) * p.ci;
                    let v = vec4<f32>(x[at + ks.x], x[at + ks.y], x[at + ks.z], x[at + ks.w]);
                    let d = p.dy_rest + (row * p.wo + ox) * p.co;
#for i in 0..4
                    c$i = fma(vec4<f32>(dy[d + n$i]), v, c$i);
#end
                }
            }
        }
#for i in 0..4
        t$i += c$i;
#end
    }
#for i in 0..4
    for (var j = 0u; j < 4u; j++) {
        if (n + ${i}u < p.co && k + j < p.ci) {
            out[to + ${i}u * p.ci + j] = t$i[j];
        }
    }
#end
}
