// pointwise, any WebGPU device: see lib/pointwise_params for the equation.
//
// Variant VEC4: n, b_len and all offsets are multiples of 4 and b_div is 1, or b is taken one by one and b_div is a multiple
// of 4. An invocation owns `steps` times four elements, 256 apart.
#import pointwise_params
#if MORE
#import pointwise_more
#endif
#if GRADIENT
#import pointwise_gradient
#endif
#import grid

#if VEC4
alias Stored = vec4<f32>;
#else
alias Stored = f32;
#endif

@group(0) @binding(1) var<storage, read> a: array<Stored>;
@group(0) @binding(2) var<storage, read> b4: array<Stored>;
@group(0) @binding(3) var<storage, read> b1: array<f32>;
@group(0) @binding(4) var<storage, read_write> y: array<Stored>;
#if SELECT
@group(0) @binding(5) var<storage, read> c: array<Stored>;
#endif

// b of the four elements from i on, whose place is `at`.
fn b_at(i: u32, at: vec2<u32>) -> vec4<f32> {
#if VEC4
    if (p.b_mode == B_SHARED) {
        return vec4<f32>(b1[at.x - p.b_first]);
    }
    let same = p.b_mode == B_SAME;
    return b4[(select(at.x, p.first + i, same) - p.b_first) / 4u];
#else
    if (p.b_mode == B_SAME) {
        let same = p.first + i - p.b_first;
        return vec4<f32>(b4[same], b4[same + 1u], b4[same + 2u], b4[same + 3u]);
    }
    return vec4<f32>(b1[at.x - p.b_first], b1[place(i + 1u).x - p.b_first], b1[place(i + 2u).x - p.b_first],
        b1[place(i + 3u).x - p.b_first]);
#endif
}

// Four elements from i on.
fn load(i: u32) -> vec4<f32> {
#if VEC4
    return a[(p.rest + i) / 4u];
#else
    let at = p.rest + i;
    return vec4<f32>(a[at], a[at + 1u], a[at + 2u], a[at + 3u]);
#endif
}

#if SELECT
// Four elements of c from i on.
fn load_c(i: u32) -> vec4<f32> {
#if VEC4
    return c[(p.rest + i) / 4u];
#else
    let at = p.rest + i;
    return vec4<f32>(c[at], c[at + 1u], c[at + 2u], c[at + 3u]);
#endif
}
#endif

fn store(i: u32, v: vec4<f32>) {
#if VEC4
    y[(p.rest + i) / 4u] = v;
#else
    for (var k = 0u; k < min(4u, p.n - i); k++) {
        y[p.rest + i + k] = v[k];
    }
#endif
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    // The operation is chosen outside of the loop.
    let first = lib_fold(group, groups) * 256u * p.steps + local.x * 4u;
    let end = min(p.n, first + 256u * p.steps);
#if TWO
    var at = place(first);
    let step = vec2<u32>(256u / p.b_div % p.b_len, 256u % p.b_div);
    for (var i = first; i < end; i += 256u) {
#if SELECT
        store(i, select(load_c(i), load(i), nonzero(b_at(i, at))));
#else
        store(i, two(p.op, p.s, p.t, load(i), b_at(i, at)));
#endif
        at = next(at, step);
    }
#else
    if (p.op < UNARY) {
        var at = place(first);
        let step = vec2<u32>(256u / p.b_div % p.b_len, 256u % p.b_div);
        for (var i = first; i < end; i += 256u) {
            store(i, binary(p.op, load(i), b_at(i, at)));
            at = next(at, step);
        }
    } else if (p.op < COSTLY) {
        for (var i = first; i < end; i += 256u) {
            store(i, simple(p.op, p.s, p.t, load(i)));
        }
    } else {
        for (var i = first; i < end; i += 256u) {
            store(i, costly(p.op, p.s, p.t, load(i)));
        }
    }
#endif
}
