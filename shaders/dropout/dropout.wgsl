// dropout: y[i] = x[i] / (1 - p) where the hash of (seed, step, stream, i) is not below p 2^32, else 0, whatever x is.
//
//   hash = h(i ^ h(stream ^ h(step ^ h(high ^ h(low))))), h of lib/hash, low and high the halves of the seed
//
// The step is read from a buffer. The gradient is the same kernel over dy. An invocation owns $STEPS elements (see lib/value),
// $LANES apart.
#import grid
#import hash
#import value

struct Params {
    // Elements of this dispatch, and the number in the whole tensor of its first.
    n: u32,
    first: u32,
    low: u32,
    high: u32,
    stream: u32,
    // What is below is left out.
    threshold: u32,
    scale: f32,
    // Distance of the first element from the start of the windows.
    rest: u32,
}

@group(0) @binding(0) var<uniform> p: Params;
@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read> step: array<u32>;
@group(0) @binding(3) var<storage, read_write> y: array<Stored>;

@compute @workgroup_size($LANES)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let first = lib_fold(group, groups) * ${LANES*STEPS}u + local.x;
    let end = min(p.n, first + ${LANES*STEPS}u);
    let q = p;
    var drawn = lib_hash(vec4<u32>(q.low));
    drawn = lib_hash(drawn ^ vec4<u32>(q.high));
    drawn = lib_hash(drawn ^ vec4<u32>(step[0]));
    drawn = lib_hash(drawn ^ vec4<u32>(q.stream));
    for (var i = first; i < end; i += ${LANES}u) {
#if VEC4
        let at = q.first + i * 4u + vec4<u32>(0u, 1u, 2u, 3u);
        let keep = lib_hash(drawn ^ at) >= vec4<u32>(q.threshold);
        y[q.rest + i] = lib_stored(select(vec4<f32>(0.0), lib_value(x[q.rest + i]) * q.scale, keep));
#else
        let keep = lib_hash(drawn ^ vec4<u32>(q.first + i)).x >= q.threshold;
        y[q.rest + i] = select(0.0, x[q.rest + i] * q.scale, keep);
#endif
    }
}
