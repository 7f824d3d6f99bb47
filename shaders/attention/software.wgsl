// attention, software devices: see lib/attention_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM queries of one head, the last one of a dispatch what is
// left; keys go by in blocks of 32. For the scores lane j owns keys 4j..4j+4 of the block, for the sums the
// channels 4j..4j+4 of each 32, of queries and of sums alike. Both products are the same loop: eight vectors come in, and
// queries, or weights, stay in registers and are spread by shuffles. A lane keeps the maximum and the sum of one row in 8.
// k and v come through 64 KiB uniform windows, the only gather a software rasteriser does without branches. No workgroup memory,
// no barrier.
#import attention_params
#import grid
#import quad
#import row_sum

@group(0) @binding(1) var<storage, read> q: array<Quad>;
@group(0) @binding(2) var<uniform> k: array<Quad, 4096>;
@group(0) @binding(3) var<uniform> v: array<Quad, 4096>;
@group(0) @binding(4) var<storage, read_write> out: array<Quad>;
@group(0) @binding(5) var<storage, read_write> state: array<vec2<f32>>;

fn top4(v: vec4<f32>) -> f32 {
    return max(max(v.x, v.y), max(v.z, v.w));
}

fn sum4(v: vec4<f32>) -> f32 {
    return (v.x + v.y) + (v.z + v.w);
}

// As lib_row_sum, the maximum.
fn row_top(even: vec4<f32>, odd: vec4<f32>, lane: u32) -> f32 {
    let bit = (vec3<u32>(lane) & vec3<u32>(1u, 2u, 4u)) != vec3<u32>(0u);
    let a = max(select(even, odd, bit.x), subgroupShuffleXor(select(odd, even, bit.x), 1u));
    let b = max(select(a.xz, a.yw, bit.y), subgroupShuffleXor(select(a.yw, a.xz, bit.y), 2u));
    return max(select(b.x, b.y, bit.z), subgroupShuffleXor(select(b.y, b.x, bit.z), 4u));
}

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let tile = lib_fold(group, groups);
    let tiles = (p.q_count + ${TM-1}u) / ${TM}u;
    let q_end = min(p.nq, p.q0 + p.q_count);
    let i = tile / tiles;
    let query = p.q0 + tile % tiles * ${TM}u;
    if (i >= p.head_count) {
        return;
    }
    let row = row_of(i, query);
    let d4 = p.head_dim / 4u;
#for r in 0..${TM/8}
    // Of row r * 8 + lane: the largest score and the sum of the weights.
    var m$r = NEVER;
    var l$r = 0.0;
#end
#for t in 0..$TM
#for v in 0..${DP/32}
    let q${t}_$v = lib_quad(q[(row + ${t}u) * ${DP/4}u + ${v*8}u + lane]);
#end
#end
    // An array, so that loops fill and empty it: unrolled, that code is larger than a first cache and runs once.
    var o: array<vec4<f32>, ${TM*DP/32}>;
    let end = min(query + ${TM}u, q_end);
    if ((p.flags & FIRST) == 0u) {
#for r in 0..${TM/8}
        let before$r = state[row + ${r*8}u + lane];
        m$r = before$r.x;
        l$r = before$r.y;
#end
        for (var t = query; t < end; t++) {
            let at = out_of(i, t) + lane;
#for v in 0..${DP/32}
            if (${v*8}u + lane < d4) {
                o[(t - query) * ${DP/32}u + ${v}u] = lib_quad(out[at + ${v*8}u]);
            }
#end
        }
    }
    let kv = i * p.kv_pad * ${DP/4}u + lane;
    for (var block = 0u; block < p.keys / 32u; block++) {
        let key = vec4<u32>(p.key0 + block * 32u + lane * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        // Scores of keys that are not there start, and so end, out of reach.
        let absent = select(vec4<f32>(0.0), vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
#for t in 0..$TM
        var s$t = absent;
#end
        var at = kv + block * ${DP*8}u;
        for (var j = 0u; j < 8u; j++) {
#for v in 0..${DP/32}
#for c in 0..4
            let k${c}_$v = lib_quad(k[at + ${v*256+c*8}u]);
#end
#for t in 0..$TM
            s$t += (subgroupShuffle(q${t}_$v[0], j) * k0_$v + subgroupShuffle(q${t}_$v[1], j) * k1_$v)
                + (subgroupShuffle(q${t}_$v[2], j) * k2_$v + subgroupShuffle(q${t}_$v[3], j) * k3_$v);
#end
#end
            at += 32u;
        }
#for r in 0..${TM/8}
        {
#for j in 0..8
            let t$j = top4(s${r*8+j});
#end
            let top = max(m$r, row_top(vec4<f32>(t0, t2, t4, t6), vec4<f32>(t1, t3, t5, t7), lane));
            let fade = exp(m$r - top);
            m$r = top;
#for j in 0..8
            s${r*8+j} = exp(s${r*8+j} - vec4<f32>(subgroupShuffle(top, ${j}u)));
            let part$j = sum4(s${r*8+j});
#end
            l$r = l$r * fade + lib_row_sum(vec4<f32>(part0, part2, part4, part6), vec4<f32>(part1, part3, part5, part7), lane);
#for j in 0..8
            {
                let fade_j = subgroupShuffle(fade, ${j}u);
#for v in 0..${DP/32}
                o[${r*8*DP/32+j*DP/32+v}] *= fade_j;
#end
            }
#end
        }
#end
        at = kv + block * ${DP*8}u;
        for (var j = 0u; j < 8u; j++) {
            // By 32 channels, then by rows: their 16 vectors of values stay in registers.
#for v in 0..${DP/32}
#for c in 0..4
            let v${c}_$v = lib_quad(v[at + ${v*8+c*DP/4}u]);
#end
#for t in 0..$TM
            o[${t*DP/32+v}] += (subgroupShuffle(s$t[0], j) * v0_$v + subgroupShuffle(s$t[1], j) * v1_$v)
                + (subgroupShuffle(s$t[2], j) * v2_$v + subgroupShuffle(s$t[3], j) * v3_$v);
#end
#end
            at += ${DP}u;
        }
    }
#for r in 0..${TM/8}
    let scale$r = select(1.0, 1.0 / l$r, (p.flags & LAST) != 0u);
    if ((p.flags & LAST) == 0u && query + ${r*8}u + lane < q_end) {
        state[row + ${r*8}u + lane] = vec2<f32>(m$r, l$r);
    }
#end
    for (var t = query; t < end; t++) {
        let place = t - query;
        var scale = 1.0;
#for r in 0..${TM/8}
        scale = select(scale, subgroupShuffle(scale$r, place % 8u), place / 8u == ${r}u);
#end
        let at = out_of(i, t) + lane;
#for v in 0..${DP/32}
        if (${v*8}u + lane < d4) {
            out[at + ${v*8}u] = lib_to_quad(o[place * ${DP/32}u + ${v}u] * scale);
        }
#end
    }
}
