// attention, software devices: see lib/attention_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM queries of one head, the last one of a dispatch what is
// left; keys go by in blocks of 32. For the scores lane j owns keys 4j..4j+4 of the block, for the sums the
// channels 4j..4j+4 of each 32; queries and weights reach the other lanes by shuffles. k and v come through
// 64 KiB uniform windows, the only gather a software rasteriser does without branches. No workgroup memory, no
// barrier.
#import attention_params
#import grid
#import quad

@group(0) @binding(1) var<storage, read> q: array<Quad>;
@group(0) @binding(2) var<uniform> k: array<Quad, 4096>;
@group(0) @binding(3) var<uniform> v: array<Quad, 4096>;
@group(0) @binding(4) var<storage, read_write> out: array<Quad>;
@group(0) @binding(5) var<storage, read_write> state: array<vec2<f32>>;

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
#for t in 0..$TM
    var m$t = NEVER;
    var l$t = 0.0;
#for v in 0..${DP/32}
    var o${t}_$v = vec4<f32>(0.0);
#end
#end
    if ((p.flags & FIRST) == 0u) {
#for t in 0..$TM
        {
            let before = state[row + ${t}u];
            m$t = before.x;
            // Lanes hold partial sums: the first takes over the whole.
            l$t = select(0.0, before.y, lane == 0u);
            if (query + ${t}u < q_end) {
                let at = out_of(i, query + ${t}u) + lane;
#for v in 0..${DP/32}
                if (${v*8}u + lane < d4) {
                    o${t}_$v = lib_quad(out[at + ${v*8}u]);
                }
#end
            }
        }
#end
    }
#for r in 0..${TM/8}
    let q$r = (row + ${r*8}u + lane) * ${DP/4}u;
#end
    let kv = i * p.kv_pad * ${DP/4}u + lane;
    for (var block = 0u; block < p.keys / 32u; block++) {
#for t in 0..$TM
        var s$t = vec4<f32>(0.0);
#end
        var at = kv + block * ${DP*8}u;
        for (var d = 0u; d < ${DP/4}u; d++) {
#for r in 0..${TM/8}
            let a$r = lib_quad(q[q$r + d]);
#end
#for c in 0..4
            let k$c = lib_quad(k[at + ${c*8}u]);
#end
#for r in 0..${TM/8}
#for j in 0..8
#for c in 0..4
            s${r*8+j} = fma(vec4<f32>(subgroupShuffle(a$r[$c], ${j}u)), k$c, s${r*8+j});
#end
#end
#end
            at += 32u;
        }
        let key = vec4<u32>(p.key0 + block * 32u + lane * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        let absent = select(vec4<f32>(0.0), vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
#for t in 0..$TM
        {
            s$t += absent;
            var top = max(max(s$t.x, s$t.y), max(s$t.z, s$t.w));
            top = max(top, subgroupShuffleXor(top, 1u));
            top = max(top, subgroupShuffleXor(top, 2u));
            top = max(top, subgroupShuffleXor(top, 4u));
            let m_new = max(m$t, top);
            let fade = exp(m$t - m_new);
            m$t = m_new;
            s$t = exp(s$t - vec4<f32>(m_new));
            l$t = l$t * fade + ((s$t.x + s$t.y) + (s$t.z + s$t.w));
#for v in 0..${DP/32}
            o${t}_$v *= fade;
#end
        }
#end
        at = kv + block * ${DP*8}u;
        for (var j = 0u; j < 8u; j++) {
#for c in 0..4
#for v in 0..${DP/32}
            let v${c}_$v = lib_quad(v[at + ${v*8}u]);
#end
            at += ${DP/4}u;
#end
#for t in 0..$TM
            {
#for c in 0..4
                let weight$c = vec4<f32>(subgroupShuffle(s$t[$c], j));
#end
#for v in 0..${DP/32}
#for c in 0..4
                o${t}_$v = fma(weight$c, v${c}_$v, o${t}_$v);
#end
#end
            }
#end
        }
    }
#for t in 0..$TM
    {
        var l = l$t;
        l += subgroupShuffleXor(l, 1u);
        l += subgroupShuffleXor(l, 2u);
        l += subgroupShuffleXor(l, 4u);
        var scale = 1.0;
        if ((p.flags & LAST) != 0u) {
            scale = 1.0 / l;
        } else if (lane == 0u && query + ${t}u < q_end) {
            state[row + ${t}u] = vec2<f32>(m$t, l);
        }
        if (query + ${t}u < q_end) {
            let at = out_of(i, query + ${t}u) + lane;
#for v in 0..${DP/32}
            if (${v*8}u + lane < d4) {
                out[at + ${v*8}u] = lib_to_quad(o${t}_$v * scale);
            }
#end
        }
    }
#end
}
