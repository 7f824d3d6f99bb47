// The tile of `attention_grad_q` (KEYS not set: queries are owned, keys and values stream) and `attention_grad_kv` (KEYS: keys and values
// are owned, queries and gradients stream) on software devices; see lib/attention_grad_params for the equation and the shapes.
//
// A workgroup is one subgroup of 8 lanes and owns $TM rows of one head; the others stream by in blocks of 32. For the two dot
// products lane j owns rows 4j..4j+4 of the block, for the sums the channels 4j..4j+4 of each 32. All are the loop of `attention`'s
// software variant: vectors come in through 64 KiB uniform windows, and what is owned, or its weights, stays in registers and is
// spread by shuffles. Streaming rows are there twice, in transposed blocks (c_blocks, d_blocks) and in rows.

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let lane = local.x;
    let tile = lib_fold(group, groups);
    let tiles = p.own_count / ${TM}u;
    let i = tile / tiles;
    let own = p.own0 + tile % tiles * ${TM}u;
    if (i >= p.head_count) {
        return;
    }
#if KEYS
    let row = key_row(i, own);
    let stream = i * p.nq_pad * ${DP/4}u;
    let streaming = p.nq;
#else
    let row = query_row(i, own);
    let stream = i * p.nk_pad * ${DP/4}u;
    let streaming = p.nk;
    let fact = i * 2u * p.nq_pad + own;
#for r in 0..${TM/8}
    // Of row r * 8 + lane.
    let top$r = facts[fact + ${r*8}u + lane];
    let delta$r = facts[fact + p.nq_pad + ${r*8}u + lane];
#end
#endif
    // Arrays, so that loops fill and empty them: unrolled, that code is larger than a first cache, runs once, and takes most of the
    // driver's compilation.
    var a: array<vec4<f32>, ${TM*DP/32}>;
    var b: array<vec4<f32>, ${TM*DP/32}>;
    var y: array<vec4<f32>, ${TM*DP/32}>;
#if KEYS
    var z: array<vec4<f32>, ${TM*DP/32}>;
#endif
    // All of them; the driver's compiler cannot see it.
    let end = min(p.own_count, ${TM}u) * ${DP/32}u;
    for (var n = 0u; n < end; n++) {
        let own_row = row + n / ${DP/32}u;
        let at = own_row * ${DP/4}u + n % ${DP/32}u * 8u + lane;
#if KEYS
        let at_k = own_row / 32u * ${DP*32}u + own_row % 32u + (n % ${DP/32}u * 8u + lane) * 128u;
        a[n] = vec4<f32>(k[at_k], k[at_k + 32u], k[at_k + 64u], k[at_k + 96u]);
        b[n] = lib_quad(v[at]);
        y[n] = vec4<f32>(0.0);
        z[n] = vec4<f32>(0.0);
        if ((p.flags & FIRST) == 0u) {
            y[n] = lib_quad(dk[at]);
            z[n] = lib_quad(dv[at]);
        }
#else
        a[n] = lib_quad(q[at]);
        b[n] = lib_quad(g[at]);
        y[n] = vec4<f32>(0.0);
        if ((p.flags & FIRST) == 0u) {
            y[n] = lib_quad(dq[at]);
        }
#endif
    }
    for (var block = 0u; block < p.stream_count / 32u; block++) {
        let there = vec4<u32>(p.stream0 + block * 32u + lane * 4u) + vec4<u32>(0u, 1u, 2u, 3u);
        // Scores of rows that are not there start, and so end, out of reach.
        let absent = select(vec4<f32>(0.0), vec4<f32>(NEVER), there >= vec4<u32>(streaming));
#for t in 0..$TM
        var s$t = absent;
        var e$t = vec4<f32>(0.0);
#end
        var at = stream + block * ${DP*8}u + lane;
        for (var j = 0u; j < 8u; j++) {
#for w in 0..${DP/32}
#for c in 0..4
            let c${c}_$w = lib_quad(c_blocks[at + ${w*256+c*8}u]);
#end
#for t in 0..$TM
            s$t += (subgroupShuffle(a[${t*DP/32+w}][0], j) * c0_$w + subgroupShuffle(a[${t*DP/32+w}][1], j) * c1_$w)
                + (subgroupShuffle(a[${t*DP/32+w}][2], j) * c2_$w + subgroupShuffle(a[${t*DP/32+w}][3], j) * c3_$w);
#end
#end
            at += 32u;
        }
        at = stream + block * ${DP*8}u + lane;
        for (var j = 0u; j < 8u; j++) {
#for w in 0..${DP/32}
#for c in 0..4
            let d${c}_$w = lib_quad(d_blocks[at + ${w*256+c*8}u]);
#end
#for t in 0..$TM
            e$t += (subgroupShuffle(b[${t*DP/32+w}][0], j) * d0_$w + subgroupShuffle(b[${t*DP/32+w}][1], j) * d1_$w)
                + (subgroupShuffle(b[${t*DP/32+w}][2], j) * d2_$w + subgroupShuffle(b[${t*DP/32+w}][3], j) * d3_$w);
#end
#end
            at += 32u;
        }
#if KEYS
        let fact = i * 2u * p.nq_pad + p.stream0 + block * 32u + lane * 4u;
        let top = lib_quad(facts[fact / 4u]);
        let delta = lib_quad(facts[(fact + p.nq_pad) / 4u]);
#for t in 0..$TM
        s$t = exp(s$t - top);
        e$t = s$t * (e$t - delta);
#end
#else
#for r in 0..${TM/8}
#for j in 0..8
        s${r*8+j} = exp(s${r*8+j} - vec4<f32>(subgroupShuffle(top$r, ${j}u)));
        e${r*8+j} = s${r*8+j} * (e${r*8+j} - vec4<f32>(subgroupShuffle(delta$r, ${j}u)));
#end
#end
#endif
        at = stream + block * ${DP*8}u + lane;
        for (var j = 0u; j < 8u; j++) {
            // By 32 channels, then by rows: their 16 vectors stay in registers.
#for w in 0..${DP/32}
#for c in 0..4
            let v${c}_$w = lib_quad(c_rows[at + ${w*8+c*DP/4}u]);
#end
#for t in 0..$TM
            y[${t*DP/32+w}] += (subgroupShuffle(e$t[0], j) * v0_$w + subgroupShuffle(e$t[1], j) * v1_$w)
                + (subgroupShuffle(e$t[2], j) * v2_$w + subgroupShuffle(e$t[3], j) * v3_$w);
#end
#end
            at += ${DP}u;
        }
#if KEYS
        at = stream + block * ${DP*8}u + lane;
        for (var j = 0u; j < 8u; j++) {
#for w in 0..${DP/32}
#for c in 0..4
            let u${c}_$w = lib_quad(d_rows[at + ${w*8+c*DP/4}u]);
#end
#for t in 0..$TM
            z[${t*DP/32+w}] += (subgroupShuffle(s$t[0], j) * u0_$w + subgroupShuffle(s$t[1], j) * u1_$w)
                + (subgroupShuffle(s$t[2], j) * u2_$w + subgroupShuffle(s$t[3], j) * u3_$w);
#end
#end
            at += ${DP}u;
        }
#endif
    }
    for (var n = 0u; n < end; n++) {
        let at = (row + n / ${DP/32}u) * ${DP/4}u + n % ${DP/32}u * 8u + lane;
#if KEYS
        // Padding has weights of its own kind; its gradients are 0.
        let mine = own + n / ${DP/32}u < p.nk;
        dk[at] = lib_to_quad(select(vec4<f32>(0.0), y[n], mine));
        dv[at] = lib_to_quad(select(vec4<f32>(0.0), z[n], mine));
#else
        dq[at] = lib_to_quad(y[n]);
#endif
    }
}
