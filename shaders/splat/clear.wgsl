// splat, before the points: nothing is anywhere in the band. One pixel an invocation.
#import splat_params
#import grid

@group(0) @binding(1) var<storage, read_write> depth: array<vec4<u32>>;
@group(0) @binding(2) var<storage, read_write> sums: array<vec4<u32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    if (i >= p.width * p.rows) {
        return;
    }
    depth[i] = vec4<u32>(LIB_EMPTY);
    sums[i] = vec4<u32>(0u);
}
