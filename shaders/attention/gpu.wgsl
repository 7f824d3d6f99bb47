// attention, GPUs: see lib/attention_params for the equation and the shapes.
//
// A workgroup of 64 owns 64 queries of one head, an invocation one: its $DP sums and the scores of 16 keys live in
// registers. 16 keys and values at a time are staged in workgroup memory ($DP * 128 bytes, 16 KiB at most) and
// read by all invocations at the same address, which GPUs broadcast.
//
// Roofline: a tile of 16 * $DP * 8 bytes feeds 64 * 16 * $DP * 4 flop, 32 flop a byte from memory.
#import attention_params
#import grid

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> out: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> state: array<vec2<f32>>;

// [channel][4 vec4 of keys] and [key][channel / 4].
var<workgroup> ks: array<vec4<f32>, ${DP*4}>;
var<workgroup> vs: array<vec4<f32>, ${DP*4}>;

@compute @workgroup_size(64)
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
    let query = p.q0 + tile % tiles * 64u + index;
    let mine = query < min(p.nq, p.q0 + p.q_count);
    // Invocations without a query follow along on the last row: all reach the barriers.
    let row = row_of(i, min(query, p.q0 + p.q_count - 1u));
    let to = out_of(i, query);
    let d4 = p.head_dim / 4u;
    var m = NEVER;
    var l = 0.0;
#for v in 0..${DP/4}
    var o$v = vec4<f32>(0.0);
#end
    if ((p.flags & FIRST) == 0u && mine) {
        let before = state[row];
        m = before.x;
        l = before.y;
#for v in 0..${DP/4}
        if (${v}u < d4) {
            o$v = out[to + ${v}u];
        }
#end
    }
    let q_at = row * ${DP/4}u;
    let kv = i * p.kv_pad * ${DP/4}u;
    for (var step = 0u; step < p.keys / 16u; step++) {
        // Half a block of keys: 4 of the 8 vec4 of each channel; 16 rows of values.
        let k_at = kv + step / 2u * ${DP*8}u + step % 2u * 4u;
        let v_at = kv + step * ${DP*4}u;
        for (var n = index; n < ${DP*4}u; n += 64u) {
            ks[n] = k[k_at + n / 4u * 8u + n % 4u];
            vs[n] = v[v_at + n];
        }
        workgroupBarrier();
#for j in 0..4
        var s$j = vec4<f32>(0.0);
#end
        for (var d = 0u; d < ${DP/4}u; d++) {
            let a = q[q_at + d];
#for c in 0..4
#for j in 0..4
            s$j = fma(vec4<f32>(a[$c]), ks[d * 16u + ${c*4+j}u], s$j);
#end
#end
        }
        var top = m;
#for j in 0..4
        {
            let key = vec4<u32>(p.key0 + step * 16u + ${j*4}u) + vec4<u32>(0u, 1u, 2u, 3u);
            s$j = select(s$j, vec4<f32>(NEVER), key >= vec4<u32>(p.nk));
            top = max(top, max(max(s$j.x, s$j.y), max(s$j.z, s$j.w)));
        }
#end
        let fade = exp(m - top);
        m = top;
        l *= fade;
#for v in 0..${DP/4}
        o$v *= fade;
#end
#for j in 0..4
        s$j = exp(s$j - vec4<f32>(m));
        l += (s$j.x + s$j.y) + (s$j.z + s$j.w);
#end
        // Loops over the keys, since software drivers take a minute to compile them unrolled; the scores move up instead
        // of being indexed, which would put them in memory.
        for (var j = 0u; j < 4u; j++) {
            for (var c = 0u; c < 4u; c++) {
                let weight = vec4<f32>(s0.x);
                let at = (j * 4u + c) * ${DP/4}u;
                s0 = s0.yzwx;
#for v in 0..${DP/4}
                o$v = fma(weight, vs[at + ${v}u], o$v);
#end
            }
            s0 = s1;
            s1 = s2;
            s2 = s3;
        }
        workgroupBarrier();
    }
    if (!mine) {
        return;
    }
    var scale = 1.0;
    if ((p.flags & LAST) != 0u) {
        scale = 1.0 / l;
    }
    if ((p.flags & KEEP) != 0u) {
        state[row] = vec2<f32>(m, l);
    }
#for v in 0..${DP/4}
    if (${v}u < d4) {
        out[to + ${v}u] = o$v * scale;
    }
#end
}
