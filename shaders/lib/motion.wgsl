// The motion of a point from nine numbers: a, b the 6D rotation, c the translation.
//
//   e1 = a / max(|a|, min_norm), u = b - (b . e1) e1, e2 = u / max(|u|, min_norm), e3 = e1 x e2; R = [e1 e2 e3] (columns)
//   moved(t) = R(t) R(own)^T x + c(t) - c(own),  or R(t) x + c(t) where motion is not relative to the own time
//
// R(own)^T x and c(own) do not depend on t: `lib_anchor` makes them once. Below min_norm R is no rotation; it is
// computed as written. Products and sums are explicit fma in one order, so that kernels that share this agree.

struct LibMotion {
    a: vec3<f32>,
    b: vec3<f32>,
    c: vec3<f32>,
}

// A point as the target times move it.
struct LibAnchor {
    x: vec3<f32>,
    c: vec3<f32>,
}

struct LibFrame {
    e1: vec3<f32>,
    e2: vec3<f32>,
    e3: vec3<f32>,
}

fn lib_dot(a: vec3<f32>, b: vec3<f32>) -> f32 {
    return fma(a.z, b.z, fma(a.y, b.y, a.x * b.x));
}

fn lib_rotation(a: vec3<f32>, b: vec3<f32>, min_norm: f32) -> LibFrame {
    let e1 = a / max(sqrt(lib_dot(a, a)), min_norm);
    let u = fma(vec3<f32>(-lib_dot(b, e1)), e1, b);
    let e2 = u / max(sqrt(lib_dot(u, u)), min_norm);
    return LibFrame(e1, e2, fma(e1.yzx, e2.zxy, -(e1.zxy * e2.yzx)));
}

// The point x seen from its own time.
fn lib_anchor(own: LibMotion, x: vec3<f32>, min_norm: f32) -> LibAnchor {
    let r = lib_rotation(own.a, own.b, min_norm);
    return LibAnchor(vec3<f32>(lib_dot(r.e1, x), lib_dot(r.e2, x), lib_dot(r.e3, x)), own.c);
}

fn lib_moved(motion: LibMotion, anchor: LibAnchor, min_norm: f32) -> vec3<f32> {
    let r = lib_rotation(motion.a, motion.b, min_norm);
    let turned = fma(r.e3, vec3<f32>(anchor.x.z), fma(r.e2, vec3<f32>(anchor.x.y), r.e1 * anchor.x.x));
    return turned + (motion.c - anchor.c);
}

// How the score decides; the host's `Gate` has the same order.
const GATE_NONE: u32 = 0u;
const GATE_HARD: u32 = 1u;
const GATE_BLEND: u32 = 2u;

// The result for a point x that motion takes to `moved`.
fn lib_gate(gate: u32, threshold: f32, theta: f32, x: vec3<f32>, moved: vec3<f32>) -> vec3<f32> {
    if (gate == GATE_HARD) {
        return select(x, moved, theta > threshold);
    }
    if (gate == GATE_BLEND) {
        return fma(vec3<f32>(theta), moved - x, x);
    }
    return moved;
}
