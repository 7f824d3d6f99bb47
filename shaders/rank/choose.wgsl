// rank, the next two bits of each row's key; see lib/rank_params.
//
// counts [rows, blocks, 4], state [rows, 2], y [rows]. A workgroup owns a row.
#import rank_params
#import grid

@group(0) @binding(1) var<storage, read> counts: array<u32>;
@group(0) @binding(2) var<storage, read_write> state: array<u32>;
@group(0) @binding(3) var<storage, read_write> y: array<u32>;

// No number has this rank.
const NONE: u32 = 0xffffffffu;

var<workgroup> joined: array<vec4<u32>, 64>;

// The rank that is wanted among `count` numbers.
fn rank_of(count: u32) -> u32 {
    if (count == 0u) {
        return NONE;
    }
    if ((p.flags & QUANTILE) == 0u) {
        return select(NONE, p.numerator, p.numerator < count);
    }
    // (count - 1) numerator / denominator without an overflow: numerator and denominator are below 65,536.
    let whole = (count - 1u) / p.denominator;
    let part = (count - 1u - whole * p.denominator) * p.numerator;
    let quotient = part / p.denominator;
    let down = whole * p.numerator + quotient;
    let twice = 2u * (part - quotient * p.denominator);
    let up = twice > p.denominator || (twice == p.denominator && (down & 1u) == 1u);
    return select(down, down + 1u, up);
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups);
    let row = min(index, p.rows - 1u);
    let base = p.counts_rest + row * p.blocks * 4u;
    var sum = vec4<u32>(0u);
    for (var b = local.x; b < p.blocks; b += 64u) {
        let at = base + b * 4u;
        sum += vec4<u32>(counts[at], counts[at + 1u], counts[at + 2u], counts[at + 3u]);
    }
    joined[local.x] = sum;
    workgroupBarrier();
    for (var span = 32u; span > 0u; span /= 2u) {
        if (local.x < span) {
            joined[local.x] += joined[local.x + span];
        }
        workgroupBarrier();
    }
    if (local.x != 0u || index != row) {
        return;
    }
    let all = joined[0];
    let to = p.state_rest + row * 2u;
    if ((p.flags & VALID) != 0u) {
        state[to] = 0u;
        state[to + 1u] = rank_of(all.x);
        return;
    }
    var rank = state[to + 1u];
    var digit = 0u;
    var known = state[to];
    if (rank != NONE) {
        for (var d = 0u; d < 3u; d++) {
            if (digit == d && rank >= all[d]) {
                rank -= all[d];
                digit = d + 1u;
            }
        }
        known |= digit << p.shift;
        state[to] = known;
        state[to + 1u] = rank;
    }
    if ((p.flags & LAST) != 0u) {
        let bits = select(~known, known & 0x7fffffffu, known >= 0x80000000u);
        y[p.y_rest + row] = select(bits, 0x7fc00000u, rank == NONE);
    }
}
