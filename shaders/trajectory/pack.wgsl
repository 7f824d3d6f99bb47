// trajectory, step 0 of the software and GPU variants: one level of the field as vec4, and the mask with it:
//
//   packed[slot, cell, 0..9] = field[time(slot), cell, 0..9], packed[slot, cell, 9] = mask[cell]
//
// slots 0..nt are the times of the range, slot nt is the image's own time (when = own, t0; times past the end count as the
// last). Cells are padded to `slot` / 3 and channels to 12. An invocation owns a cell.
#import deform_params
#import grid

@group(0) @binding(1) var<storage, read> field: array<f32>;
@group(0) @binding(2) var<storage, read> mask: array<f32>;
@group(0) @binding(3) var<storage, read> when: array<u32>;
@group(0) @binding(4) var<storage, read_write> packed: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let cells = p.hp * p.wp;
    let slot = index / cells;
    let cell = index - slot * cells;
    if (slot > p.nt) {
        return;
    }
    let t = min(select(when[1] + slot, when[0], slot == p.nt), p.times - 1u);
    let at = p.x_rest + (t * cells + cell) * 9u;
    let dest = p.y_rest + slot * p.slot + cell * 3u;
    packed[dest] = vec4<f32>(field[at], field[at + 1u], field[at + 2u], field[at + 3u]);
    packed[dest + 1u] = vec4<f32>(field[at + 4u], field[at + 5u], field[at + 6u], field[at + 7u]);
    packed[dest + 2u] = vec4<f32>(field[at + 8u], mask[cell], 0.0, 0.0);
}
