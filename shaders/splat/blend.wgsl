// splat, second pass over the points: at each sample the discs of the frontmost surface are mixed. A disc belongs to it if it is no
// farther than (1 + layer) times the nearest depth and half its own radius; its share falls from the centre to the edge, in whole
// fifteenths, so that sums are integers and have one value whatever the order of the points.
//
// One point an invocation. SUMS [rows, width, 4]: red, green and blue times shares, and shares, over a pixel's samples. A sum holds
// 280,000 discs at one place in one layer; thinning keeps surfaces far below that.
#import splat
#import grid

@group(0) @binding(4) var<storage, read> colours: array<u32>;
@group(0) @binding(5) var<storage, read> depth: array<u32>;
@group(0) @binding(6) var<storage, read_write> sums: array<atomic<u32>>;

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
    let reach = splat.radius * splat.radius;
    let layer = 1.0 + view[4].z;
    let colour = colours[p.colours_rest + i];
    let red = colour & 255u;
    let green = (colour >> 8u) & 255u;
    let blue = (colour >> 16u) & 255u;
    for (var y = splat.low.y; y <= splat.high.y; y++) {
        let span = lib_span(splat, y);
        for (var x = span.x; x <= span.y; x++) {
            let distances = lib_distances(splat, x, y);
            let shares = vec4<u32>(15.0 - 14.0 * clamp(distances / reach, vec4<f32>(0.0), vec4<f32>(1.0)));
            let at = lib_pixel(x, y) * 4u;
            var share = 0u;
#for k in 0..4
            if (distances[$k] <= reach && splat.z <= bitcast<f32>(depth[at + ${k}u]) * layer + splat.thickness) {
                share += shares[$k];
            }
#end
            if (share > 0u) {
                atomicAdd(&sums[at], share * red);
                atomicAdd(&sums[at + 1u], share * green);
                atomicAdd(&sums[at + 2u], share * blue);
                atomicAdd(&sums[at + 3u], share);
            }
        }
    }
}
