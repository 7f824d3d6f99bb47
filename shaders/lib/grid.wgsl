// Workgroup index of a one-dimensional problem folded over x and y, because WebGPU allows 65,535
// workgroups a dimension. The host folds with `Dispatch::fold`; the caller checks the upper bound.
fn lib_fold(group: vec3<u32>, groups: vec3<u32>) -> u32 {
    return group.y * groups.x + group.x;
}
