// rank, counts of a block; see lib/rank_params.
//
// x [rows, n], state [rows, 2] (the wanted key's bits so far, the rank among the keys that have them), counts [rows, blocks, 4]. A
// workgroup owns a block, each invocation every 64th number of it.
#import rank_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<u32>;
@group(0) @binding(2) var<storage, read> state: array<u32>;
@group(0) @binding(3) var<storage, read_write> counts: array<u32>;

var<workgroup> joined: array<vec4<u32>, 64>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups);
    // Workgroups past the end repeat the last block and write nothing, so that barriers stay uniform.
    let place = min(index, p.rows * p.blocks - 1u);
    let row = place / p.blocks;
    let start = (place - row * p.blocks) * p.block;
    let end = min(start + p.block, p.n);
    let base = p.x_rest + row * p.n;
    let wanted = state[p.state_rest + row * 2u];
    let valid = (p.flags & VALID) != 0u;
    let shift = p.shift;
    // Keys agree with the wanted one above the two bits of this pass; at the top there is nothing to agree on.
    let top = shift == 30u;
    var sum = vec4<u32>(0u);
    for (var i = start + local.x; i < end; i += 64u) {
        let k = key(x[base + i]);
        if (valid) {
            sum.x += select(0u, 1u, k != NAN_KEY);
        } else {
            let same = top || ((k ^ wanted) >> (min(shift, 29u) + 2u)) == 0u;
            let digit = (k >> shift) & 3u;
            sum += select(vec4<u32>(0u), vec4<u32>(1u), (vec4<u32>(digit) == vec4<u32>(0u, 1u, 2u, 3u)) & vec4<bool>(same));
        }
    }
    joined[local.x] = sum;
    workgroupBarrier();
    for (var span = 32u; span > 0u; span /= 2u) {
        if (local.x < span) {
            joined[local.x] += joined[local.x + span];
        }
        workgroupBarrier();
    }
    if (local.x < 4u && index == place) {
        counts[p.counts_rest + place * 4u + local.x] = joined[0][local.x];
    }
}
