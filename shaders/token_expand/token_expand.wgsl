// token_expand: every token once for every target time, any WebGPU device:
//
//   z[t, r, :] = q[r, :] * (1 + alpha[r] * scale[t, :]) + kappa[r] * shift[t, :]
//
// q [m, d], scale [T, d] (absent: 0), shift [T, d], alpha [m] and kappa [m] (absent: 1), z [T, m, d].
// Eight neighbouring invocations move a row together, `steps` elements each, 8 apart. A dispatch owns
// `rows` tokens of `times` times; rows of z are `stride` tokens apart from time to time.
#import grid
#import value

const HAS_SCALE: u32 = 1u;
const HAS_ALPHA: u32 = 2u;
const HAS_KAPPA: u32 = 4u;

struct Params {
    // Tokens and times of this dispatch, tokens in all.
    rows: u32,
    times: u32,
    stride: u32,
    // Elements of a row (see lib/value), pieces a row, elements an invocation in a piece.
    d: u32,
    pieces: u32,
    steps: u32,
    flags: u32,
    // Distances of the first element from the start of the windows.
    q_rest: u32,
    scale_rest: u32,
    shift_rest: u32,
    alpha_rest: u32,
    kappa_rest: u32,
    z_rest: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> q: array<Stored>;
@group(0) @binding(2) var<storage, read> scale: array<Stored>;
@group(0) @binding(3) var<storage, read> shift: array<Stored>;
@group(0) @binding(4) var<storage, read> alpha: array<f32>;
@group(0) @binding(5) var<storage, read> kappa: array<f32>;
@group(0) @binding(6) var<storage, read_write> z: array<Stored>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let piece = lib_fold(group, groups) * 8u + local.x / 8u;
    let row = piece / p.pieces;
    if (row >= p.rows * p.times) {
        return;
    }
    let t = row / p.rows;
    let r = row - t * p.rows;
    var a = 1.0;
    if ((p.flags & HAS_ALPHA) != 0u) {
        a = alpha[p.alpha_rest + r];
    }
    var k = 1.0;
    if ((p.flags & HAS_KAPPA) != 0u) {
        k = kappa[p.kappa_rest + r];
    }
    let first = (piece - row * p.pieces) * p.steps * 8u + local.x % 8u;
    let source = p.q_rest + r * p.d;
    let dest = p.z_rest + (t * p.stride + r) * p.d;
    for (var s = 0u; s < p.steps; s++) {
        let i = first + s * 8u;
        if (i < p.d) {
            var v = lib_value(q[source + i]);
            if ((p.flags & HAS_SCALE) != 0u) {
                v *= 1.0 + a * lib_value(scale[p.scale_rest + t * p.d + i]);
            }
            z[dest + i] = lib_stored(v + k * lib_value(shift[p.shift_rest + t * p.d + i]));
        }
    }
}
