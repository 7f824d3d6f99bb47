// linear_weights, any WebGPU device: see lib/linear_weights_params for the equation, the shapes and the order of the sums.
//
// An invocation owns 4 columns of dy x 4 of x of one section; both are read one number at a time so that every m, n and k is
// allowed. No workgroup memory: right everywhere, fast nowhere.
#import linear_weights_params
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
    let tile = index % (p.n_tiles * p.k_tiles);
    let section = index / (p.n_tiles * p.k_tiles);
    let n = p.n0 + tile / p.k_tiles * 4u;
    let k = tile % p.k_tiles * 4u;
    let first = section * p.section;
    if (first >= p.m) {
        return;
    }
    let end = min(first + p.section, p.m);
    // Columns past the end read the last one; they are not written.
    let ks = min(vec4<u32>(k) + vec4<u32>(0u, 1u, 2u, 3u), vec4<u32>(p.k - 1u));
    let to = p.out_rest + section * p.out_step + (n - p.n0) * p.k + k;
#for i in 0..4
    let n$i = min(n + ${i}u, p.n - 1u);
    var t$i = vec4<f32>(0.0);
#end
    if ((p.flags & GO_ON) != 0u) {
#for i in 0..4
        for (var j = 0u; j < 4u; j++) {
            if (n + ${i}u < p.n1 && k + j < p.k) {
                t$i[j] = out[to + ${i}u * p.k + j];
            }
        }
#end
    }
    for (var part = first; part < end; part += PART) {
#for i in 0..4
        var c$i = vec4<f32>(0.0);
#end
        let stop = min(part + PART, end);
        for (var row = part; row < stop; row++) {
            let at = row * p.k;
            let v = vec4<f32>(x[at + ks.x], x[at + ks.y], x[at + ks.z], x[at + ks.w]);
#for i in 0..4
            c$i = fma(vec4<f32>(dy[row * p.n + n$i]), v, c$i);
#end
        }
#for i in 0..4
        t$i += c$i;
#end
    }
#for i in 0..4
    for (var j = 0u; j < 4u; j++) {
        if (n + ${i}u < p.n1 && k + j < p.k) {
            out[to + ${i}u * p.k + j] = t$i[j];
        }
    }
#end
}
