// top_k: of each row x[r, :] of n numbers the k largest: their indices, ascending, and a mask [n] of 1 and 0.
// Flat indices are plus r * n.
// Ties: the lower index wins; -0 equals 0; NaN counts as lowest. 1 <= k <= n.
//
// A workgroup owns a row. Numbers become unsigned keys of the same order. The k-th largest key is found bit
// by bit from the top: 32 times, the row's keys that are not below the candidate are counted (32 n reads a
// row, no sorting, integers only). Then each invocation owns a run of neighbours, and the runs' counts say
// where its results go. All barriers are in uniform control flow: loop bounds depend on n alone.
#import grid

struct Params {
    rows: u32,
    n: u32,
    k: u32,
    // Distances of the first element from the start of the windows.
    x_rest: u32,
    i_rest: u32,
    m_rest: u32,
    // Whether indices count over all rows, and the first row of this dispatch.
    flat: u32,
    row0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<u32>;
@group(0) @binding(2) var<storage, read_write> index: array<u32>;
@group(0) @binding(3) var<storage, read_write> mask: array<f32>;

const LANES: u32 = 64u;
var<workgroup> counts: array<vec2<u32>, LANES>;

// An unsigned number that orders as the float with these bits; NaN is 0, both zeros are equal.
fn order(bits: u32) -> u32 {
    let size = bits & 0x7fffffffu;
    if (size > 0x7f800000u) {
        return 0u;
    }
    if (size == 0u) {
        return 0x80000000u;
    }
    return select(bits | 0x80000000u, ~bits, bits != size);
}

// The sum of all invocations' counts; every invocation calls it.
fn total(lane: u32, count: u32) -> u32 {
    counts[lane].x = count;
    workgroupBarrier();
    var sum = 0u;
    for (var i = 0u; i < LANES; i++) {
        sum += counts[i].x;
    }
    workgroupBarrier();
    return sum;
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let row = lib_fold(group, groups);
    // Workgroups past the end repeat the last row and write nothing, so that barriers stay uniform.
    let base = p.x_rest + min(row, p.rows - 1u) * p.n;
    var limit = 0u;
    for (var bit = 0u; bit < 32u; bit++) {
        let candidate = limit | (0x80000000u >> bit);
        var count = 0u;
        for (var i = lane; i < p.n; i += LANES) {
            count += select(0u, 1u, order(x[base + i]) >= candidate);
        }
        if (total(lane, count) >= p.k) {
            limit = candidate;
        }
    }
    // limit is the k-th largest key: fewer than k are above it; of those equal to it the first ones win.
    let run = (p.n + LANES - 1u) / LANES;
    let start = min(lane * run, p.n);
    let end = min(start + run, p.n);
    var own = vec2<u32>(0u);
    for (var i = start; i < end; i++) {
        let key = order(x[base + i]);
        own += vec2<u32>(select(0u, 1u, key > limit), select(0u, 1u, key == limit));
    }
    counts[lane] = own;
    workgroupBarrier();
    var before = vec2<u32>(0u);
    var above = 0u;
    for (var i = 0u; i < LANES; i++) {
        above += counts[i].x;
        before += select(vec2<u32>(0u), counts[i], i < lane);
    }
    if (row >= p.rows) {
        return;
    }
    let equals = p.k - above;
    let to = p.i_rest + row * p.k;
    let mask_to = p.m_rest + row * p.n;
    var place = before.x + min(before.y, equals);
    var seen = before.y;
    let base_index = select(0u, (p.row0 + row) * p.n, p.flat != 0u);
    for (var i = start; i < end; i++) {
        let key = order(x[base + i]);
        let equal = key == limit;
        let chosen = key > limit || (equal && seen < equals);
        seen += select(0u, 1u, equal);
        mask[mask_to + i] = select(0.0, 1.0, chosen);
        if (chosen) {
            index[to + place] = base_index + i;
            place += 1u;
        }
    }
}
