// splat, first pass over the points: the depth of the nearest disc at each of a pixel's four samples. Positive floats are in
// the order of their bits, so the minimum of integers is that of depths, and has one value whatever the order of the points.
//
// One point an invocation. DEPTH [rows, width, 4].
#import splat
#import grid

@group(0) @binding(4) var<storage, read_write> depth: array<atomic<u32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    if (i >= p.n) {
        return;
    }
    let splat = lib_splat(i);
    let bits = bitcast<u32>(splat.z);
    let reach = splat.radius * splat.radius;
    for (var y = splat.low.y; y <= splat.high.y; y++) {
        let span = lib_span(splat, y);
        for (var x = span.x; x <= span.y; x++) {
            let inside = lib_distances(splat, x, y) <= vec4<f32>(reach);
            let at = lib_pixel(x, y) * 4u;
#for k in 0..4
            // A look first: most discs lie behind what is there, and looking is cheaper than writing.
            if (inside[$k] && atomicLoad(&depth[at + ${k}u]) > bits) {
                atomicMin(&depth[at + ${k}u], bits);
            }
#end
        }
    }
}
