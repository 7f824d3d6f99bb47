// attention, GPUs with cooperative matrices: see lib/attention_params for the equation and the shapes, lib/cooperative for the
// operations.
//
// A workgroup of 128 owns 64 queries of one head in four strips of 16, a subgroup one strip; surplus subgroups and those that
// take several strips in turn are treated as in lib/tile_cooperative. A subgroup keeps its queries and its sums as matrices in
// registers. $T keys and values at a time are staged in workgroup memory; scores leave the matrices through workgroup memory,
// where two neighbouring invocations share the softmax of a row, and enter again as weights.
//
// The elements of a matrix cannot be scaled by row where they are: the sums go through workgroup memory too when a maximum
// grows. So the maximum is followed with slack: a row keeps the one it has until a score exceeds it by SLACK, weights are at
// most e^SLACK = 245 and as exact as those below 1, and after the first keys few steps rescale. Which do depends on the
// scores of a workgroup, but a row whose own maximum stayed is multiplied by 1: no bit depends on its neighbours.
//
// Roofline, $T keys and 64 queries: 64 * $T * $DP * 4 flop for $T * $DP * 8 bytes of keys and values, 32 flop a byte from L2 as
// in subgroup.wgsl; 2 TB/s feed 64 TFLOP/s, where plain multiply-adds end at 20 to 60. Of workgroup memory a strip reads every
// key and value once a step, 16 multiply-adds a number: with f16 8 a byte, 1024 a clock for the 128 bytes a unit delivers,
// what its matrix unit takes; scores and weights add (4 + 2) * 2 bytes a score, a tenth at 64 channels. The exponentials, one
// a score, take 64 * $T / 16 clocks of a special function unit of 16 a clock against $DP * $T * 128 / 1024 of the matrix unit:
// half of its time at 64 channels, and other warps fill it. Occupancy: queries and sums are 96 registers at 128 channels, 48 at
// 64; workgroup memory ${DP*64} bytes of keys and values and 7.5 KiB (f16, 16 x 16) or 5 KiB (f32, 8 x 8) of scores and
// weights: within WebGPU's 16 KiB at every width, 5 workgroups in 64 KiB at 64 channels.
#if HALF
enable f16;
#endif
#if !LANES
enable wgpu_cooperative_matrix;
#endif
#import attention_params
#import grid
#import cooperative

@group(0) @binding(1) var<storage, read> q: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> k: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read> v: array<vec4<f32>>;
@group(0) @binding(4) var<storage, read_write> out: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> state: array<vec2<f32>>;

// By how much a score may exceed the maximum that weights are relative to.
const SLACK: f32 = 5.5;

// [channel][key] of the keys, then [key][channel] of the values.
var<workgroup> ws: array<CoopNumber, ${DP*T*2}>;
// [strip][row][key or channel]: queries, $T channels at a time, later weights; and scores or sums. The fifth strip is that of
// surplus subgroups.
#if LANES
// Matrices are places there, so queries have places of their own.
const APART: u32 = ${16*T*5}u;
var<workgroup> xs: array<CoopNumber, ${16*T*5+16*5*DP}>;
#else
const APART: u32 = 0u;
var<workgroup> xs: array<CoopNumber, ${16*T*5}>;
#endif
var<workgroup> cs: array<f32, ${16*T*5}>;
// Whether the maximum of a row grew.
var<workgroup> grown: atomic<u32>;
var<workgroup> rescale: u32;

@compute @workgroup_size(128)
fn main(
    @builtin(local_invocation_index) index: u32,
#if !LANES
    @builtin(subgroup_id) subgroup: u32,
    @builtin(num_subgroups) subgroups: u32,
#endif
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
#if LANES
    let subgroup = index / ${LANES}u;
    let subgroups = ${128/LANES}u;
    coop_lane = index % ${LANES}u;
#endif
    let tile = lib_fold(group, groups);
    let tiles = (p.q_count + 63u) / 64u;
    let i = tile / tiles;
    if (i >= p.head_count) {
        return;
    }
    // The row of this invocation and its neighbour, and where its half of a strip's row lies in xs and cs.
    let query = p.q0 + tile % tiles * 64u + index / 2u;
    let mine = query < min(p.nq, p.q0 + p.q_count);
    let row = row_of(i, min(query, p.q0 + p.q_count - 1u));
    let to = out_of(i, query);
    let half = index % 2u * ${T/2}u;
    let at = index / 2u * ${T}u + half;
    let kv = i * p.kv_pad * ${DP/4}u;
    for (var turn = 0u; turn < 4u; turn += subgroups) {
        let strip = min(turn + subgroup, 4u) * ${16*T}u;
        // Whether the row's strip is one of this turn.
        let here = index / 32u >= turn && index / 32u < turn + subgroups;
        var m = NEVER;
        var l = 0.0;
        if ((p.flags & FIRST) == 0u) {
            let before = state[row];
            m = before.x;
            l = before.y;
        }
#for d in 0..${DP/T}
        if (here) {
#for e in 0..${T/8}
            {
                let part = vec4<CoopNumber>(q[row * ${DP/4}u + (${d*T+e*4}u + half) / 4u]);
#for j in 0..4
                xs[at + ${d+1}u * APART + ${e*4+j}u] = part[$j];
#end
            }
#end
        }
        workgroupBarrier();
#for r in 0..${16/T}
        let q${r}_$d = coop_a(strip + ${d+1}u * APART + ${r*T*T}u, ${T}u);
        var o${r}_$d = coop_zero();
#end
        workgroupBarrier();
#end
        if ((p.flags & FIRST) == 0u) {
#for d in 0..${DP/T}
            if (here) {
#for e in 0..${T/8}
                {
                    let channel = ${d*T+e*4}u + half;
                    var part = vec4<f32>(0.0);
                    if (mine && channel < p.head_dim) {
                        part = out[to + channel / 4u];
                    }
#for j in 0..4
                    cs[at + ${e*4+j}u] = part[$j];
#end
                }
#end
            }
            workgroupBarrier();
#for r in 0..${16/T}
            o${r}_$d = coop_c(strip + ${r*T*T}u);
#end
            workgroupBarrier();
#end
        }
        for (var step = 0u; step < p.keys / ${T}u; step++) {
            let k_at = kv + step / ${32/T}u * ${DP*8}u + step % ${32/T}u * ${T/4}u;
            let v_at = kv + step * ${DP*T/4}u;
            for (var n = index; n < ${DP*T/4}u; n += 128u) {
                let keys = vec4<CoopNumber>(k[k_at + n / ${T/4}u * 8u + n % ${T/4}u]);
                let values = vec4<CoopNumber>(v[v_at + n]);
#for j in 0..4
                ws[n * 4u + ${j}u] = keys[$j];
                ws[n * 4u + ${DP*T+j}u] = values[$j];
#end
            }
            if (index == 0u) {
                atomicStore(&grown, 0u);
            }
            workgroupBarrier();
#for r in 0..${16/T}
            var s$r = coop_zero();
#end
#for d in 0..${DP/T}
            {
                let b = coop_b(${d*T*T}u, ${T}u);
#for r in 0..${16/T}
                s$r = coop_fma(q${r}_$d, b, s$r);
#end
            }
#end
#for r in 0..${16/T}
            coop_store(s$r, strip + ${r*T*T}u);
#end
            workgroupBarrier();
            // Both invocations of a row hold the same bits of m, l and fade: max and + do not depend on the order of two.
            var top = NEVER;
#for e in 0..${T/2}
            var s_$e = select(cs[at + ${e}u], NEVER, p.key0 + step * ${T}u + half + ${e}u >= p.nk);
            top = max(top, s_$e);
#end
            top = max(top, subgroupShuffleXor(top, 1u));
            let m_new = select(m, top, top > m + SLACK);
            let fade = exp(m - m_new);
            var sum = 0.0;
#for e in 0..${T/2}
            let w_$e = CoopNumber(exp(s_$e - m_new));
            sum += f32(w_$e);
#end
            l = l * fade + (sum + subgroupShuffleXor(sum, 1u));
            if (here) {
#for e in 0..${T/2}
                xs[at + ${e}u] = w_$e;
#end
                if (m_new > m) {
                    atomicStore(&grown, 1u);
                }
            }
            m = m_new;
            workgroupBarrier();
            if (index == 0u) {
                rescale = atomicLoad(&grown);
            }
            if (workgroupUniformLoad(&rescale) != 0u) {
#for d in 0..${DP/T}
#for r in 0..${16/T}
                coop_store(o${r}_$d, strip + ${r*T*T}u);
#end
                workgroupBarrier();
                if (here) {
#for e in 0..${T/2}
                    cs[at + ${e}u] *= fade;
#end
                }
                workgroupBarrier();
#for r in 0..${16/T}
                o${r}_$d = coop_c(strip + ${r*T*T}u);
#end
                workgroupBarrier();
#end
            }
#for r in 0..${16/T}
            let w$r = coop_a(strip + ${r*T*T}u, ${T}u);
#end
#for d in 0..${DP/T}
            {
                let b = coop_b(${DP*T+d*T}u, ${DP}u);
#for r in 0..${16/T}
                o${r}_$d = coop_fma(w$r, b, o${r}_$d);
#end
            }
#end
            workgroupBarrier();
        }
        var scale = 1.0;
        if ((p.flags & LAST) != 0u) {
            scale = 1.0 / l;
        }
        if ((p.flags & KEEP) != 0u && here && mine && half == 0u) {
            state[row] = vec2<f32>(m, l);
        }
#for d in 0..${DP/T}
#for r in 0..${16/T}
        coop_store(o${r}_$d, strip + ${r*T*T}u);
#end
        workgroupBarrier();
        if (here && mine) {
#for e in 0..${T/8}
            {
                let channel = ${d*T+e*4}u + half;
                if (channel < p.head_dim) {
                    out[to + channel / 4u] = scale * vec4<f32>(cs[at + ${e*4}u], cs[at + ${e*4+1}u], cs[at + ${e*4+2}u], cs[at + ${e*4+3}u]);
                }
            }
#end
        }
        workgroupBarrier();
#end
    }
}
