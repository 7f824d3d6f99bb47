// pack, kernels of 3 x 3 transformed for Winograd's algorithm on the way:
//
//   y[block][place k_lo + c][column] = (G w Gᵀ)[place], w[tap] = x[base + n_hi n + k_hi tap + k_step c], n = 32 block + column
//
// and 0 where n is beyond the matrix. G evaluates a column of three as a polynomial at 0, ±3/4, ±3/2 and infinity, each over the product of
// its distances from the others (crates/omnix-kernels/src/winograd.rs has the reasons). An invocation owns all places of a column and a
// channel: neighbours write neighbouring words.
#import pack_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> y: array<u32>;

const NEAR: f32 = 0.75;
const FAR: f32 = 1.5;
const AT_ZERO: f32 = 1.0 / (NEAR * NEAR * FAR * FAR);
const AT_NEAR: f32 = 1.0 / (2.0 * NEAR * NEAR * (NEAR * NEAR - FAR * FAR));
const AT_FAR: f32 = 1.0 / (2.0 * FAR * FAR * (FAR * FAR - NEAR * NEAR));

struct Six {
#for i in 0..6
    v$i: f32,
#end
}

// G (a, b, c).
fn evaluate(a: f32, b: f32, c: f32) -> Six {
    let near = a + NEAR * NEAR * c;
    let far = a + FAR * FAR * c;
    return Six(
        a * AT_ZERO,
        (near + NEAR * b) * AT_NEAR,
        (near - NEAR * b) * AT_NEAR,
        (far + FAR * b) * AT_FAR,
        (far - FAR * b) * AT_FAR,
        c,
    );
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let q = p;
    let line = lib_fold(group, groups) * 2u + local.x / 32u;
    let column = local.x % 32u;
    let block = line / q.k_lo;
    if (block >= q.blocks) {
        return;
    }
    let c = line - block * q.k_lo;
    let n = (q.first_block + block) * 32u + column;
    let inside = n < q.n;
    let at = q.base + q.n_hi * n + q.k_step * c;
#for t in 0..9
    let w$t = select(0.0, x[select(0u, at + ${t}u * q.k_hi, inside)], inside);
#end
#for c in 0..3
    let taps$c = evaluate(w$c, w${c+3}, w${c+6});
#end
    var word = (block * q.rows + c) * 32u + column;
#for r in 0..6
    let row$r = evaluate(taps0.v$r, taps1.v$r, taps2.v$r);
#for i in 0..6
    y[word] = bitcast<u32>(row$r.v$i);
    word += q.k_lo * 32u;
#end
#end
}
