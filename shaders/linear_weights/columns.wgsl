// linear_weights, the column sums of rows, any WebGPU device: see lib/linear_weights_params for the order of the sums.
//
//   out[section, n] = sum_m x[m, n]
//
// An invocation owns a column (lib/value: four of them) of a section.
#import linear_weights_params
#import grid
#import value

@group(0) @binding(1) var<storage, read> x: array<Stored>;
@group(0) @binding(2) var<storage, read_write> out: array<Stored>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let section = index / p.n;
    let first = section * p.section;
    if (first >= p.m) {
        return;
    }
    let column = index - section * p.n;
    let end = min(first + p.section, p.m);
    let to = p.out_rest + section * p.out_step + column;
    var total = Value();
    if ((p.flags & GO_ON) != 0u) {
        total = lib_value(out[to]);
    }
    for (var part = first; part < end; part += PART) {
        var sum = Value();
        let stop = min(part + PART, end);
        for (var row = part; row < stop; row++) {
            sum += lib_value(x[row * p.n + column]);
        }
        total += sum;
    }
    out[to] = lib_stored(total);
}
