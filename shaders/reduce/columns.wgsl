// reduce over blocks of columns side by side, software devices: y[outer, part, inner] as reduce.wgsl, inner a multiple of 4.
//
// op: sum, maximum or minimum. An invocation owns four neighbouring columns of a block, as two 64-bit words, and walks its block in
// order: the bits of reduce.wgsl.
#import reduce_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read_write> y: array<Stored>;

@compute @workgroup_size(8)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 8u + local.x;
    // In fours: columns of this dispatch, and from an element of the axis to the next.
    let width = p.width / 4u;
    let inner = p.inner / 4u;
    if (index >= p.outer * p.parts * width) {
        return;
    }
    let place = index / width;
    let column = index - place * width;
    let outer = place / p.parts;
    let start = (place - outer * p.parts) * p.block;
    let count = min(p.block, p.n - start);
    var at = p.x_skip / 4u + (outer * p.n + start) * inner + column;
    let to = p.y_skip / 4u + place * inner + column;
    let op = p.op;
    var sum = Value();
    var top = lib_value(x[at]);
    var least = top;
    if ((p.flags & GO_ON) != 0u) {
        let before = lib_value(y[to]);
        sum = before;
        top = max(top, before);
        least = min(least, before);
    }
    for (var i = 0u; i < count; i++) {
        let v = lib_value(x[at]);
        sum += v;
        top = max(top, v);
        least = min(least, v);
        at += inner;
    }
    y[to] = lib_stored(select(select(sum, top, op == OP_MAX), least, op == OP_MIN));
}
