// pack: y[block][k][column] = x[base + n_hi · (n / n_lo) + n_step · (n % n_lo) + k_hi · (k / k_lo) + k_step · (k % k_lo)] with
// n = 32 · block + column, and 0 where n or k is beyond the matrix: weights in the layout that matrix products read
// (lib/weights). An index may count down: steps are added modulo 2³².
//
// An invocation owns a column of a block and $ROWS of its rows: neighbours write neighbouring words, and each walks along its column, so
// that divisions are made once. HALF: a word has k and k + 1 as f16.
#import pack_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<u32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let q = p;
    let line = lib_fold(group, groups) * 2u + local.x / 32u;
    let column = local.x % 32u;
    let block = line / q.chunks;
    if (block >= q.blocks) {
        return;
    }
    let n = (q.first_block + block) * 32u + column;
    let first = (line - block * q.chunks) * ${ROWS}u;
    let end = min(first + ${ROWS}u, q.rows);
#if HALF
    var k = first * 2u;
#else
    var k = first;
#endif
    // Where the weight at depth k lies, and its place in its group of depths.
    var at = q.base + q.n_hi * (n / q.n_lo) + q.n_step * (n % q.n_lo) + q.k_hi * (k / q.k_lo) + q.k_step * (k % q.k_lo);
    var inner = k % q.k_lo;
    let next_group = q.k_hi - q.k_step * (q.k_lo - 1u);
    var word = (block * q.rows + first) * 32u + column;
    for (var row = first; row < end; row++) {
#if HALF
        var pair = vec2<f32>();
#for h in 0..2
        pair[$h] = select(0.0, x[select(0u, at, n < q.n && k < q.k)], n < q.n && k < q.k);
        k += 1u;
        inner += 1u;
        at += select(q.k_step, next_group, inner == q.k_lo);
        inner = select(inner, 0u, inner == q.k_lo);
#end
        y[word] = pack2x16float(pair);
#else
        let inside = n < q.n && k < q.k;
        y[word] = bitcast<u32>(select(0.0, x[select(0u, at, inside)], inside));
        k += 1u;
        inner += 1u;
        at += select(q.k_step, next_group, inner == q.k_lo);
        inner = select(inner, 0u, inner == q.k_lo);
#endif
        word += 32u;
    }
}
