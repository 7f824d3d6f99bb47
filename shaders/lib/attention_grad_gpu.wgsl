// The tile of `attention_grad_q` (KEYS not set: queries are owned, keys and values stream) and `attention_grad_kv` (KEYS: keys and values
// are owned, queries and gradients stream) on GPUs; see lib/attention_grad_params for the equation and the shapes.
//
// A workgroup of 128 owns 32 rows of one head; four neighbouring invocations share a row, of which each has every fourth vec4 of
// both operands and of the sums in registers. 8 streaming rows at a time are staged in workgroup memory. Each invocation leaves its
// part of the 16 dot products there, all four then add the parts in the same order and hold the same bits.
//
// Roofline, 8 streaming rows: 32 * 8 * $DP * 6 flop (8 with KEYS) for 8 * $DP * 8 bytes, 24 flop a byte from L2 (32). A vec4 from
// workgroup memory, which 32 rows read at once, serves 8 operations; the exchange is 8 stores and 32 loads of 8 bytes a row and
// invocation against ${DP/4*48} operations. ${DP*3/4} numbers of operands and sums (${DP} with KEYS), about 40 of indices; workgroup memory
// ${DP*64+8192} bytes. Three barriers per 8 rows: with several workgroups a unit others compute meanwhile.
var<workgroup> cs: array<vec4<f32>, ${DP*2}>;
var<workgroup> ds: array<vec4<f32>, ${DP*2}>;
// [streaming row][invocation]
var<workgroup> parts: array<vec2<f32>, 1024>;

@compute @workgroup_size(128)
fn main(
    @builtin(local_invocation_index) index: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups);
    let tiles = p.own_count / 32u;
    let i = tile / tiles;
    if (i >= p.head_count) {
        return;
    }
    let lane = index % 4u;
    let own = p.own0 + tile % tiles * 32u + index / 4u;
#if KEYS
    let row = key_row(i, own);
    let stream = i * p.nq_pad;
    let streaming = p.nq;
    let mine = own < p.nk;
    // Channel 0 of the key in its block.
    let block = row / 32u * ${DP*32}u + row % 32u;
#for v in 0..${DP/16}
    let at$v = block + (${v*4}u + lane) * 128u;
    let a$v = vec4<f32>(k[at$v], k[at$v + 32u], k[at$v + 64u], k[at$v + 96u]);
    let b$v = v[row * ${DP/4}u + ${v*4}u + lane];
    var y$v = vec4<f32>(0.0);
    var z$v = vec4<f32>(0.0);
    if ((p.flags & FIRST) == 0u) {
        y$v = dk[row * ${DP/4}u + ${v*4}u + lane];
        z$v = dv[row * ${DP/4}u + ${v*4}u + lane];
    }
#end
#else
    let row = query_row(i, own);
    let stream = i * p.nk_pad;
    let streaming = p.nk;
    let mine = own < p.nq;
    let fact = i * 2u * p.nq_pad + own;
    let top = facts[fact];
    let delta = facts[fact + p.nq_pad];
#for v in 0..${DP/16}
    let a$v = q[row * ${DP/4}u + ${v*4}u + lane];
    let b$v = g[row * ${DP/4}u + ${v*4}u + lane];
    var y$v = vec4<f32>(0.0);
    if ((p.flags & FIRST) == 0u) {
        y$v = dq[row * ${DP/4}u + ${v*4}u + lane];
    }
#end
#endif
    let quad = index / 4u * 4u;
    // 8, which compilers cannot see: software drivers take twice as long to compile the loops unrolled.
    let rows = min(p.stream_count, 8u);
    for (var step = 0u; step < p.stream_count / 8u; step++) {
#if KEYS
        let from_row = (stream + step * 8u) * ${DP/4}u;
        for (var n = index; n < ${DP*2}u; n += 128u) {
            cs[n] = q[from_row + n];
            ds[n] = g[from_row + n];
        }
#else
        let from_row = (stream + step * 8u) * ${DP/4}u;
        for (var n = index; n < ${DP*2}u; n += 128u) {
            ds[n] = v[from_row + n];
        }
        // Four channels of four keys, turned.
        let from_block = (stream + step / 4u * 32u) * ${DP/4}u + step % 4u * 2u;
        for (var n = index; n < ${DP/2}u; n += 128u) {
            let at = from_block + n / 2u * 32u + n % 2u;
            let turned = transpose(mat4x4<f32>(k[at], k[at + 8u], k[at + 16u], k[at + 24u]));
#for e in 0..4
            cs[(n % 2u * 4u + ${e}u) * ${DP/4}u + n / 2u] = turned[$e];
#end
        }
#endif
        workgroupBarrier();
        for (var r = 0u; r < rows; r++) {
            let at = r * ${DP/4}u + lane;
            var s = 0.0;
            var e = 0.0;
#for v in 0..${DP/16}
            s += dot(a$v, cs[at + ${v*4}u]);
            e += dot(b$v, ds[at + ${v*4}u]);
#end
            parts[r * 128u + index] = vec2<f32>(s, e);
        }
        workgroupBarrier();
        for (var r = 0u; r < rows; r++) {
            let part = r * 128u + quad;
            let both = (parts[part] + parts[part + 1u]) + (parts[part + 2u] + parts[part + 3u]);
            let there = p.stream0 + step * 8u + r;
#if KEYS
            // Padding too has facts.
            let at_fact = i * 2u * p.nq_pad + there;
            let top = facts[at_fact];
            let delta = facts[at_fact + p.nq_pad];
#endif
            let weight = select(0.0, exp(both.x - top), there < streaming && mine);
            let f = weight * (both.y - delta);
            let at = r * ${DP/4}u + lane;
#for v in 0..${DP/16}
            y$v = fma(vec4<f32>(f), cs[at + ${v*4}u], y$v);
#if KEYS
            z$v = fma(vec4<f32>(weight), ds[at + ${v*4}u], z$v);
#endif
#end
        }
        workgroupBarrier();
    }
#for v in 0..${DP/16}
#if KEYS
    dk[row * ${DP/4}u + ${v*4}u + lane] = select(vec4<f32>(0.0), y$v, mine);
    dv[row * ${DP/4}u + ${v*4}u + lane] = select(vec4<f32>(0.0), z$v, mine);
#else
    dq[row * ${DP/4}u + ${v*4}u + lane] = y$v;
#endif
#end
}
