// attention, software devices: see lib/attention_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM queries of one head, the last one of a dispatch what is
// left; keys go by in blocks of 32. For the scores lane j owns keys 4j..4j+4 of the block, for the sums the
// channels 4j..4j+4 of each 32. While scores are summed, s_i of lane j belongs to row i ^ j (of 8): exclusive-or
// shuffles of q are cheaper than broadcasts (lib/product_step), and a lane keeps the maximum and the sum of one row
// in 8. "Rows in order" then gives s_i of all lanes to row i. k and v come through 64 KiB uniform windows, the only
// gather a software rasteriser does without branches. No workgroup memory, no barrier.
#import attention_params
#import grid
#import quad

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
    // Of row r * 8 + lane: the largest score, the sum of the weights, where its query lies.
    var m$r = NEVER;
    var l$r = 0.0;
    let q$r = (row + ${r*8}u + lane) * ${DP/4}u;
#end
#for t in 0..$TM
#for v in 0..${DP/32}
    var o${t}_$v = vec4<f32>(0.0);
#end
#end
    if ((p.flags & FIRST) == 0u) {
#for r in 0..${TM/8}
        let before$r = state[row + ${r*8}u + lane];
        m$r = before$r.x;
        l$r = before$r.y;
#end
#for t in 0..$TM
        if (query + ${t}u < q_end) {
            let at = out_of(i, query + ${t}u) + lane;
#for v in 0..${DP/32}
            if (${v*8}u + lane < d4) {
                o${t}_$v = lib_quad(out[at + ${v*8}u]);
            }
#end
        }
#end
    }
    let bit0 = (lane & 1u) != 0u;
    let bit1 = (lane & 2u) != 0u;
    let bit2 = (lane & 4u) != 0u;
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
            s${r*8+j} = fma(vec4<f32>(subgroupShuffleXor(a$r[$c], ${j}u)), k$c, s${r*8+j});
#end
#end
#end
            at += 32u;
        }
        let key = vec4<u32>(p.key0 + block * 32u + lane * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        let absent = select(vec4<f32>(0.0), vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
#for r in 0..${TM/8}
        {
            var top = m$r;
#for j in 0..8
            s${r*8+j} += absent;
            top = max(top, subgroupShuffleXor(top4(s${r*8+j}), ${j}u));
#end
            let fade = exp(m$r - top);
            m$r = top;
#for j in 0..8
            s${r*8+j} = exp(s${r*8+j} - vec4<f32>(subgroupShuffleXor(top, ${j}u)));
            let part$j = subgroupShuffleXor(sum4(s${r*8+j}), ${j}u);
#end
            // Lane l has the parts in the order j ^ l. Added in pairs they give the same bits in every order of that kind, so a
            // row's sum does not depend on its place in the tile.
            l$r = l$r * fade + (((part0 + part1) + (part2 + part3)) + ((part4 + part5) + (part6 + part7)));
            // Rows in order: exchange s_i and s_(i ^ b) in the lanes with bit b, for each b.
#for c in 0..4
            {
#for h in 0..4
                let e${h*2} = select(s${r*8+h*2}[$c], s${r*8+h*2+1}[$c], bit0);
                let e${h*2+1} = select(s${r*8+h*2+1}[$c], s${r*8+h*2}[$c], bit0);
#end
#for g in 0..2
#for h in 0..2
                let f${g*4+h} = select(e${g*4+h}, e${g*4+h+2}, bit1);
                let f${g*4+h+2} = select(e${g*4+h+2}, e${g*4+h}, bit1);
#end
#end
#for h in 0..4
                s${r*8+h}[$c] = select(f$h, f${h+4}, bit2);
                s${r*8+h+4}[$c] = select(f${h+4}, f$h, bit2);
#end
            }
#end
#for j in 0..8
            {
                let fade_j = subgroupShuffle(fade, ${j}u);
#for v in 0..${DP/32}
                o${r*8+j}_$v *= fade_j;
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
#for c in 0..4
            o${t}_$v = fma(vec4<f32>(subgroupShuffle(s$t[$c], j)), v${c}_$v, o${t}_$v);
#end
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
#for j in 0..8
    {
        let scale = subgroupShuffle(scale$r, ${j}u);
        if (query + ${r*8+j}u < q_end) {
            let at = out_of(i, query + ${r*8+j}u) + lane;
#for v in 0..${DP/32}
            if (${v*8}u + lane < d4) {
                out[at + ${v*8}u] = lib_to_quad(o${r*8+j}_$v * scale);
            }
#end
        }
    }
#end
#end
}
