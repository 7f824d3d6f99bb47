// deform_sample_grad: the gradient of deform_sample with respect to where each pixel samples and by what weight, any WebGPU device.
//
// For one sampling point and each of its four cells v = sum_{t, c} dtau[i, 9 t + c] field[l, t, cell, c] + dtau[i, 9 T] mask[cell], 0
// for a cell outside; then
//
//   dweight = B(v),  doffset = weight (dB / dx, dB / dy), 0 where the position is clamped
//
// with B bilinear; a cell's bounds belong to the cell that begins there. dtau [n, 9 T + 1], doffsets [n, levels, points, 2], dweights
// [n, levels, points]. An invocation owns one sampling point, and walks times and channels in order.
#import deform_grad
#import grid

@group(0) @binding(1) var<storage, read> offsets: array<f32>;
@group(0) @binding(2) var<storage, read> weights: array<f32>;
@group(0) @binding(3) var<storage, read> pixels: array<u32>;
@group(0) @binding(4) var<storage, read> field: array<f32>;
@group(0) @binding(5) var<storage, read> mask: array<f32>;
@group(0) @binding(6) var<storage, read> dtau: array<f32>;
@group(0) @binding(7) var<storage, read_write> doffsets: array<f32>;
@group(0) @binding(8) var<storage, read_write> dweights: array<f32>;

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local.x;
    let taps = p.levels * p.points;
    let i = index / taps;
    if (i >= p.n) {
        return;
    }
    let level = (index - i * taps) / p.points;
    var pixel = p.first + i;
    if ((p.flags & LISTED) != 0u) {
        pixel = pixels[p.i_rest + i];
    }
    let o = p.o_rest + index * 2u;
    let place = lib_place(lib_reference(pixel), vec2<f32>(offsets[o], offsets[o + 1u]));
    let cells = p.hp * p.wp;
    var g = p.y_rest + i * (p.times * 9u + 1u);
    var base = level * p.times * cells;
    var v = vec4<f32>(0.0);
    for (var t = 0u; t < p.times; t++) {
        let at = (vec4<u32>(base) + place.cell) * 9u;
#for c in 0..9
        v = fma(vec4<f32>(dtau[g + ${c}u]),
            vec4<f32>(field[at.x + ${c}u], field[at.y + ${c}u], field[at.z + ${c}u], field[at.w + ${c}u]), v);
#end
        g += 9u;
        base += cells;
    }
    let masks = vec4<f32>(mask[place.cell.x], mask[place.cell.y], mask[place.cell.z], mask[place.cell.w]);
    v = fma(vec4<f32>(dtau[g]), masks, v) * place.inside;
    let f = place.fraction;
    let rest = vec2<f32>(1.0) - f;
    let weight = weights[p.w_rest + index];
    let to_x = fma(f.y, v.w - v.z, rest.y * (v.y - v.x));
    let to_y = fma(f.x, v.w - v.y, rest.x * (v.z - v.x));
    doffsets[o] = weight * place.follows.x * to_x;
    doffsets[o + 1u] = weight * place.follows.y * to_y;
    dweights[p.w_rest + index] = fma(f.y, fma(f.x, v.w, rest.x * v.z), rest.y * fma(f.x, v.y, rest.x * v.x));
}
