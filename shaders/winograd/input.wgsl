// winograd, first pass: V = Bt d B for each tile and channel; see lib/winograd_params.
//
// An invocation owns a tile and 4 channels.
#import winograd_params
#import grid

@group(0) @binding(1) var<storage, read> x: array<Quad>;
@group(0) @binding(2) var<storage, read_write> v: array<Quad>;

// pre(x) of 4 channels; 0 outside of the map.
fn tap(frame: u32, y: i32, column: i32, c: u32) -> vec4<f32> {
    let on = y >= 0 && y < i32(p.hi) && column >= 0 && column < i32(p.wi);
    let at = select(0u, ((frame * p.hi + u32(y)) * p.wi + u32(column)) * (p.ci / 4u) + c, on);
    return select(vec4<f32>(0.0), max(lib_quad(x[p.x_rest / 4u + at]), vec4<f32>(p.low)), on);
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let index = lib_fold(group, groups) * 64u + local;
    let width = p.ci / 4u;
    let row = index / width;
    if (row >= p.tiles) {
        return;
    }
    let c = index - row * width;
    let at = lib_tile(p.tile0 + row);
    let y = i32(at.y) - i32(p.pad);
    let column = i32(at.z) - i32(p.pad);
#for j in 0..4
    let d0$j = tap(at.x, y, column + ${j}, c);
    let d1$j = tap(at.x, y + 1, column + ${j}, c);
    let d2$j = tap(at.x, y + 2, column + ${j}, c);
    let d3$j = tap(at.x, y + 3, column + ${j}, c);
    let t0$j = d0$j - d2$j;
    let t1$j = d1$j + d2$j;
    let t2$j = d2$j - d1$j;
    let t3$j = d1$j - d3$j;
#end
    var to = row * width + c;
    let place = p.stride * width;
#for i in 0..4
    v[to] = lib_to_quad(t${i}0 - t${i}2);
    v[to + place] = lib_to_quad(t${i}1 + t${i}2);
    v[to + 2u * place] = lib_to_quad(t${i}2 - t${i}1);
    v[to + 3u * place] = lib_to_quad(t${i}1 - t${i}3);
    to += 4u * place;
#end
}
