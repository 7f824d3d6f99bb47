// attention, software devices: see lib/attention_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM queries of one head, the last one of a dispatch what is
// left; keys go by in blocks of 32. For the scores lane j owns keys 4j..4j+4 of the block, for the sums the
// channels 4j..4j+4 of each 32, with WIDE (W = 2 vectors a load) 8j..8j+8 of each 64, of queries and of sums alike. Both products are the same loop: eight vectors come in, and
// queries, or weights, stay in registers and are spread by shuffles. A lane keeps the maximum and the sum of one row in 8.
// k and v come through 64 KiB uniform windows, the only gather a software rasteriser does without branches. No workgroup memory,
// no barrier.
#import attention_params
#import grid
#import quad
#import row_sum
#import value

@group(0) @binding(1) var<storage, read> q: array<Stored>;
@group(0) @binding(2) var<uniform> k: array<Quad, 4096>;
@group(0) @binding(3) var<uniform> v: array<Quad, 4096>;
@group(0) @binding(4) var<storage, read_write> out: array<Stored>;
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
    let units = p.head_dim / ${W*4}u;
#for r in 0..${TM/8}
    // Of row r * 8 + lane: the largest score and the sum of the weights.
    var m$r = NEVER;
    var l$r = 0.0;
#end
#for t in 0..$TM
#for w in 0..${DP/32/W}
    let wide${t}_$w = lib_value(q[(row + ${t}u) * ${DP/4/W}u + ${w*8}u + lane]);
#for h in 0..$W
#if WIDE
    let q${t}_${w*W+h} = wide${t}_$w[$h];
#else
    let q${t}_${w*W+h} = wide${t}_$w;
#endif
#end
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
            let at = out_of(i, t) / ${W}u + lane;
#for w in 0..${DP/32/W}
            if (${w*8}u + lane < units) {
                let before = lib_value(out[at + ${w*8}u]);
#if WIDE
                o[(t - query) * ${DP/32}u + ${w*2}u] = before[0];
                o[(t - query) * ${DP/32}u + ${w*2+1}u] = before[1];
#else
                o[(t - query) * ${DP/32}u + ${w}u] = before;
#endif
            }
#end
        }
    }
    let kv = i * p.kv_pad * ${DP/4}u;
    for (var block = 0u; block < p.keys / 32u; block++) {
        let key = vec4<u32>(p.key0 + block * 32u + lane * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        // Scores of keys that are not there start, and so end, out of reach.
        let absent = select(vec4<f32>(0.0), vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
#for t in 0..$TM
        var s$t = absent;
#end
        var at = kv + block * ${DP*8}u + lane;
        for (var j = 0u; j < 8u; j++) {
#for w in 0..${DP/32/W}
#for h in 0..$W
#for c in 0..4
            let k${c}_${w*W+h} = lib_quad(k[at + ${w*W*256+h*32+c*8}u]);
#end
#for t in 0..$TM
            s$t += (subgroupShuffle(q${t}_${w*W+h}[0], j) * k0_${w*W+h} + subgroupShuffle(q${t}_${w*W+h}[1], j) * k1_${w*W+h})
                + (subgroupShuffle(q${t}_${w*W+h}[2], j) * k2_${w*W+h} + subgroupShuffle(q${t}_${w*W+h}[3], j) * k3_${w*W+h});
#end
#end
#end
            at += ${W*32}u;
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
        at = kv + block * ${DP*8}u + lane * ${W}u;
        for (var j = 0u; j < 8u; j++) {
            // By 32 channels, then by rows: their 16 vectors of values stay in registers.
#for w in 0..${DP/32/W}
#for h in 0..$W
#for c in 0..4
            let v${c}_${w*W+h} = lib_quad(v[at + ${w*W*8+h+c*DP/4}u]);
#end
#for t in 0..$TM
            o[${t*DP/32+w*W+h}] += (subgroupShuffle(s$t[0], j) * v0_${w*W+h} + subgroupShuffle(s$t[1], j) * v1_${w*W+h})
                + (subgroupShuffle(s$t[2], j) * v2_${w*W+h} + subgroupShuffle(s$t[3], j) * v3_${w*W+h});
#end
#end
#end
            at += ${DP}u;
        }
    }
#for r in 0..${TM/8}
    let scale$r = select(1.0, 1.0 / l$r, (p.flags & LAST) != 0u);
    if ((p.flags & KEEP) != 0u && query + ${r*8}u + lane < q_end) {
        state[row + ${r*8}u + lane] = vec2<f32>(m$r, l$r);
    }
#end
    for (var t = query; t < end; t++) {
        let place = t - query;
        var scale = 1.0;
#for r in 0..${TM/8}
        scale = select(scale, subgroupShuffle(scale$r, place % 8u), place / 8u == ${r}u);
#end
        let at = out_of(i, t) / ${W}u + lane;
#for w in 0..${DP/32/W}
        if (${w*8}u + lane < units) {
#if WIDE
            let first = place * ${DP/32}u + ${w*2}u;
            out[at + ${w*8}u] = lib_to_wide(o[first] * scale, o[first + 1u] * scale);
#else
            out[at + ${w*8}u] = lib_to_quad(o[place * ${DP/32}u + ${w}u] * scale);
#endif
        }
#end
    }
}
