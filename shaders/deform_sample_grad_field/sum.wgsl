// deform_sample_grad_field, the copies of all parts added; see deform_sample_grad_field.wgsl.
//
//   dfield[l, t, cell, c] = sum_part copies[part, l, cell, 9 t + c],  dmask[cell] = sum_part sum_l copies[part, l, cell, 9 T]
//
// An invocation owns a number of dfield or dmask and adds in order of the slots (part, level). They may come in several dispatches.
#import deform_params
#import grid

// Whether what is added to is not yet there.
const CLEAR: u32 = 4u;

@group(0) @binding(1) var<storage, read> copies: array<f32>;
@group(0) @binding(2) var<storage, read_write> dfield: array<f32>;
@group(0) @binding(3) var<storage, read_write> dmask: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let cells = p.hp * p.wp;
    // Of a cell's row of a copy.
    let width = (p.times * 9u + 1u + 3u) / 4u * 4u;
    let all = p.levels * p.times * cells * 9u;
    if (index >= all + cells) {
        return;
    }
    let clear = (p.flags & CLEAR) != 0u;
    let slot_words = cells * width;
    // skip: the first slot of this dispatch; nt: how many it has.
    if (index >= all) {
        let cell = index - all;
        var sum = 0.0;
        if (!clear) {
            sum = dmask[cell];
        }
        var source = p.x_rest + cell * width + p.times * 9u;
        for (var s = 0u; s < p.nt; s++) {
            sum += copies[source];
            source += slot_words;
        }
        dmask[cell] = sum;
        return;
    }
    let row = index / 9u;
    let c = index - row * 9u;
    let place = row / cells;
    let cell = row - place * cells;
    let level = place / p.times;
    let t = place - level * p.times;
    var sum = 0.0;
    if (!clear) {
        sum = dfield[index];
    }
    // The first slot of this dispatch that has the level.
    let before = p.skip % p.levels;
    let first = select(level - before, level + p.levels - before, level < before);
    for (var s = first; s < p.nt; s += p.levels) {
        sum += copies[p.x_rest + s * slot_words + cell * width + t * 9u + c];
    }
    dfield[index] = sum;
}
