// attention, GPUs with subgroups: see lib/attention_params for the equation and the shapes.
//
// A workgroup owns 64 queries of one head, four neighbouring lanes share $Q of them: each lane sums a quarter of the channels
// of every score, two exchanges within the four complete it, and each keeps a quarter of the channels of the result.
// Subgroups have at least four lanes, a power of two, and consecutive invocations, so the four always share one; nothing
// else depends on the width. All four lanes hold the same bits of a score: a + b is b + a. 16 keys and values at a
// time are staged in workgroup memory, with HALF as f16; sums are f32.
//
// Roofline, 16 keys and 64 queries: 64 * 16 * $DP * 4 flop for 16 * $DP * 8 bytes of keys and values: 32 flop a byte from
// L2, where all queries of a head find them; 1 TB/s feeds 32 TFLOP/s. A vec4 from workgroup memory serves 4 * $Q multiply-
// adds a lane, and the lanes of all groups of four read the same 64 bytes: per 32 lanes $DP reads of one access each, 8 * $Q
// shuffles of 4 numbers and 16 * $Q exponentials against $DP * 8 * $Q multiply-adds, which take longest at every width.
// The variant without subgroups (gpu.wgsl) needs all $DP sums of a query in one lane; here ${DP/4*Q} and ${16*Q} scores, about
// ${DP/4*Q+16*Q+40} registers: at 64 channels 104, 576 invocations a 64 K-register unit, at 128 channels 88.
// Workgroup memory ${DP*128} bytes, half of it with HALF: up to 16 KiB, so with wide heads it, not registers, bounds the number
// of workgroups, and HALF doubles it. HALF's conversions (two vec4 a read) are free or cheap where f16 is fast.
#if HALF
enable f16;
#endif
#import attention_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> out: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> state: array<vec2<f32>>;

#if HALF
alias Number4 = vec4<f16>;
#else
alias Number4 = vec4<f32>;
#endif
// Channel c = 16 i + 4 lane + e of keys 4 j .. 4 j + 3 at ((4 i + e) * 4 + j) * 4 + lane: the four lanes read side by side.
var<workgroup> ks: array<Number4, ${DP*4}>;
// [key][channel / 4]; lane l owns the vec4 l, l + 4, …
var<workgroup> vs: array<Number4, ${DP*4}>;

fn over_four(x: vec4<f32>) -> vec4<f32> {
    let two = x + subgroupShuffleXor(x, 1u);
    return two + subgroupShuffleXor(two, 2u);
}

@compute @workgroup_size(${256/Q})
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups);
    let tiles = (p.q_count + 63u) / 64u;
    let i = tile / tiles;
    if (i >= p.head_count) {
        return;
    }
    let lane = index % 4u;
    let d4 = p.head_dim / 4u;
#for a in 0..$Q
    let query$a = p.q0 + tile % tiles * 64u + index / 4u * ${Q}u + ${a}u;
    let mine$a = query$a < min(p.nq, p.q0 + p.q_count);
    // Lanes without a query follow along on the last row: all reach barriers and shuffles.
    let row$a = row_of(i, min(query$a, p.q0 + p.q_count - 1u));
    let to$a = out_of(i, query$a);
    var m$a = NEVER;
    var l$a = 0.0;
#for v in 0..${DP/16}
    var o${a}_$v = vec4<f32>(0.0);
#end
    if ((p.flags & FIRST) == 0u && mine$a) {
        let before = state[row$a];
        m$a = before.x;
        l$a = before.y;
#for v in 0..${DP/16}
        if (${v*4}u + lane < d4) {
            o${a}_$v = out[to$a + ${v*4}u + lane];
        }
#end
    }
#end
    let kv = i * p.kv_pad * ${DP/4}u;
    for (var step = 0u; step < p.keys / 16u; step++) {
        // Half a block of keys: 4 of the 8 vec4 of each channel; 16 rows of values.
        let k_at = kv + step / 2u * ${DP*8}u + step % 2u * 4u;
        let v_at = kv + step * ${DP*4}u;
        for (var n = index; n < ${DP*4}u; n += ${256/Q}u) {
            let c = n / 4u;
            ks[((c / 16u * 4u + c % 4u) * 4u + n % 4u) * 4u + c / 4u % 4u] = Number4(k[k_at + c * 8u + n % 4u]);
            vs[n] = Number4(v[v_at + n]);
        }
        workgroupBarrier();
#for a in 0..$Q
#for j in 0..4
        var s${a}_$j = vec4<f32>(0.0);
#end
#end
        for (var d = 0u; d < ${DP/16}u; d++) {
#for a in 0..$Q
            let q$a = q[row$a * ${DP/4}u + d * 4u + lane];
#end
#for e in 0..4
#for j in 0..4
            {
                let keys = vec4<f32>(ks[d * 64u + ${e*16+j*4}u + lane]);
#for a in 0..$Q
                s${a}_$j = fma(vec4<f32>(q$a[$e]), keys, s${a}_$j);
#end
            }
#end
#end
        }
#for a in 0..$Q
        var top$a = m$a;
#for j in 0..4
        {
            let key = vec4<u32>(p.key0 + step * 16u + ${j*4}u) + vec4<u32>(0u, 1u, 2u, 3u);
            s${a}_$j = select(over_four(s${a}_$j), vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
            top$a = max(top$a, max(max(s${a}_$j.x, s${a}_$j.y), max(s${a}_$j.z, s${a}_$j.w)));
        }
#end
        let fade$a = exp(m$a - top$a);
        m$a = top$a;
        l$a *= fade$a;
#for v in 0..${DP/16}
        o${a}_$v *= fade$a;
#end
#for j in 0..4
        s${a}_$j = exp(s${a}_$j - vec4<f32>(m$a));
        l$a += (s${a}_$j.x + s${a}_$j.y) + (s${a}_$j.z + s${a}_$j.w);
#end
#end
        // Loops over the keys, since software drivers take a minute to compile them unrolled; the scores move up instead
        // of being indexed, which would put them in memory.
        for (var j = 0u; j < 4u; j++) {
            for (var c = 0u; c < 4u; c++) {
                let at = (j * 4u + c) * ${DP/4}u + lane;
#for v in 0..${DP/16}
                let v$v = vec4<f32>(vs[at + ${v*4}u]);
#end
#for a in 0..$Q
#for v in 0..${DP/16}
                o${a}_$v = fma(vec4<f32>(s${a}_0.x), v$v, o${a}_$v);
#end
                s${a}_0 = s${a}_0.yzwx;
#end
            }
#for a in 0..$Q
            s${a}_0 = s${a}_1;
            s${a}_1 = s${a}_2;
            s${a}_2 = s${a}_3;
#end
        }
        workgroupBarrier();
    }
#for a in 0..$Q
    if (mine$a) {
        var scale = 1.0;
        if ((p.flags & LAST) != 0u) {
            scale = 1.0 / l$a;
        }
        if ((p.flags & KEEP) != 0u && lane == 0u) {
            state[row$a] = vec2<f32>(m$a, l$a);
        }
#for v in 0..${DP/16}
        if (${v*4}u + lane < d4) {
            out[to$a + ${v*4}u + lane] = o${a}_$v * scale;
        }
#end
    }
#end
}
