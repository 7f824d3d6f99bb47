// adamw: one step of AdamW with decoupled weight decay, in place (as torch.optim.AdamW):
//
//   g = factor grad
//   m = m + (g - m) (1 - beta1),  v = beta2 v + (1 - beta2) g^2
//   w = keep w - rate m / (sqrt(v) / root + eps)
//
// rates [4] = (keep, rate, root, unused): keep = 1 - lr decay, rate = lr / (1 - beta1^step), root = sqrt(1 - beta2^step), made on the
// host, which has the digits that a difference from 1 needs. factor is clip[0] of grad_norm, or a constant; where clip[2] says that
// the norm of the gradients is NaN or infinite, nothing changes.
//
// Memory bound: 28 bytes a number. An invocation owns $STEPS elements (see lib/value), $LANES apart.
#import grid
#import value

const HAS_CLIP: u32 = 1u;

struct Params {
    // Elements of this dispatch.
    n: u32,
    flags: u32,
    // Distance of the first element from the start of the windows.
    rest: u32,
    scale: f32,
    // 1 - beta1, beta2, 1 - beta2.
    to_m: f32,
    keep_v: f32,
    to_v: f32,
    eps: f32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> grad: array<Stored>;
@group(0) @binding(2) var<storage, read> rates: array<f32>;
@group(0) @binding(3) var<storage, read> clip: array<f32>;
@group(0) @binding(4) var<storage, read_write> weights: array<Stored>;
@group(0) @binding(5) var<storage, read_write> first_moment: array<Stored>;
@group(0) @binding(6) var<storage, read_write> second_moment: array<Stored>;

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let q = p;
    var factor = q.scale;
    if ((q.flags & HAS_CLIP) != 0u) {
        if (clip[2] != 0.0) {
            return;
        }
        factor = clip[0];
    }
    let keep = rates[0];
    let rate = rates[1];
    let root = rates[2];
    let first = lib_fold(group, groups) * ${LANES*STEPS}u + local.x;
    let end = min(q.n, first + ${LANES*STEPS}u);
    for (var i = first; i < end; i += ${LANES}u) {
        let at = q.rest + i;
        let g = lib_value(grad[at]) * factor;
        let before = lib_value(first_moment[at]);
        let m = before + (g - before) * q.to_m;
        let v = lib_value(second_moment[at]) * q.keep_v + g * g * q.to_v;
        let w = lib_value(weights[at]) * keep - rate * (m / (sqrt(v) / root + q.eps));
        first_moment[at] = lib_stored(m);
        second_moment[at] = lib_stored(v);
        weights[at] = lib_stored(w);
    }
}
