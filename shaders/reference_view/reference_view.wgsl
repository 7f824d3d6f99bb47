// reference_view: which of s views is the reference, from their class tokens x [s, c], and the order of views
// with it in front: order = [ref, 0, 1, .., ref-1, ref+1, ..], inverse[order[i]] = i, ref [1].
//
// With u_s = x_s / |x_s| and sim = u u^T - I:
//   saddle balanced: three numbers a view (mean similarity sum_t sim[s,t] / (s-1); |x_s|; variance of the
//   components of u_s, divisor c-1), each scaled over views to 0..1 by (v - min) / (max - min + 1e-8); score
//   = sum of |v - 0.5|; the least score wins, the first on ties.
//   saddle similarity range: the largest max_t sim[s,t] - min_t sim[s,t] wins, the zero diagonal included.
//
// Stages follow each other as dispatches. Until the last two, `order` holds one number a view (as bits) and
// `inverse` the score so far. O(s^2 c): each invocation walks all other views.
#import grid

const MEAN_SIMILARITY: u32 = 0u;
const LENGTH: u32 = 1u;
const VARIANCE: u32 = 2u;
const RANGE: u32 = 3u;
const SCORE: u32 = 4u;
const CHOOSE: u32 = 5u;
const WRITE: u32 = 6u;

struct Params {
    s: u32,
    c: u32,
    stage: u32,
    // SCORE: 1 starts the sum, 0 adds. CHOOSE: 1 takes `forced` instead.
    start: u32,
    forced: u32,
    // The views of this dispatch.
    first: u32,
    end: u32,
    pad0: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read_write> order: array<u32>;
@group(0) @binding(3) var<storage, read_write> inverse: array<u32>;
@group(0) @binding(4) var<storage, read_write> reference: array<u32>;

// (x_a . x_b, x_b . x_b). Sums of 16 first: rounding grows with their number, not with c.
fn dots(a: u32, b: u32) -> vec2<f32> {
    var sum = vec2<f32>(0.0);
    for (var from_c = 0u; from_c < p.c; from_c += 16u) {
        var part = vec2<f32>(0.0);
        for (var i = from_c; i < min(from_c + 16u, p.c); i++) {
            let v = x[b * p.c + i];
            part += vec2<f32>(x[a * p.c + i] * v, v * v);
        }
        sum += part;
    }
    return sum;
}

fn length_of(view: u32) -> f32 {
    return sqrt(dots(view, view).x);
}

// (sum over t of sim, max, min), each over all views, the diagonal as 0.
fn similarity(view: u32) -> vec3<f32> {
    let own = length_of(view);
    var v = vec3<f32>(0.0);
    for (var t = 0u; t < p.s; t++) {
        if (t != view) {
            let d = dots(view, t);
            let sim = d.x / (own * sqrt(d.y));
            v = vec3<f32>(v.x + sim, max(v.y, sim), min(v.z, sim));
        }
    }
    return v;
}

// Two passes: the mean first.
fn variance(view: u32) -> f32 {
    let scale = 1.0 / length_of(view);
    var sum = 0.0;
    for (var from_c = 0u; from_c < p.c; from_c += 16u) {
        var part = 0.0;
        for (var i = from_c; i < min(from_c + 16u, p.c); i++) {
            part += x[view * p.c + i];
        }
        sum += part;
    }
    let mean = sum * scale / f32(p.c);
    var squares = 0.0;
    for (var from_c = 0u; from_c < p.c; from_c += 16u) {
        var part = 0.0;
        for (var i = from_c; i < min(from_c + 16u, p.c); i++) {
            let d = x[view * p.c + i] * scale - mean;
            part += d * d;
        }
        squares += part;
    }
    return squares / f32(max(p.c, 2u) - 1u);
}

// How far the view's number is from the middle of all views'.
fn distance_from_middle(view: u32) -> f32 {
    var low = bitcast<f32>(order[0]);
    var high = low;
    for (var t = 1u; t < p.s; t++) {
        let v = bitcast<f32>(order[t]);
        low = min(low, v);
        high = max(high, v);
    }
    return abs((bitcast<f32>(order[view]) - low) / (high - low + 1e-8) - 0.5);
}

fn least() -> u32 {
    var best = 0u;
    for (var t = 1u; t < p.s; t++) {
        if (bitcast<f32>(inverse[t]) < bitcast<f32>(inverse[best])) {
            best = t;
        }
    }
    return best;
}

fn write(i: u32) {
    let chosen = reference[0];
    order[i] = select(select(i, i - 1u, i <= chosen), chosen, i == 0u);
    inverse[i] = select(select(i, i + 1u, i < chosen), 0u, i == chosen);
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = p.first + lib_fold(group, groups) * 64u + local.x;
    if (i >= p.end) {
        return;
    }
    switch p.stage {
        case MEAN_SIMILARITY: { order[i] = bitcast<u32>(similarity(i).x / f32(max(p.s, 2u) - 1u)); }
        case LENGTH: { order[i] = bitcast<u32>(length_of(i)); }
        case VARIANCE: { order[i] = bitcast<u32>(variance(i)); }
        case RANGE: {
            let v = similarity(i);
            inverse[i] = bitcast<u32>(v.z - v.y);
        }
        case SCORE: {
            let before = select(bitcast<f32>(inverse[i]), 0.0, p.start != 0u);
            inverse[i] = bitcast<u32>(before + distance_from_middle(i));
        }
        case CHOOSE: {
            if (i == 0u) {
                if (p.start != 0u) {
                    reference[0] = p.forced;
                } else {
                    reference[0] = least();
                }
            }
        }
        default: { write(i); }
    }
}
