// conv2d, any WebGPU device: see lib/conv2d_params for the equation and the shapes.
//
// An invocation owns 4 pixels x 4 channels; x is read one number at a time so that any number of
// channels is allowed. Sums run over k in order.
#import conv2d_params
#import grid
#import packed_storage

@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(3) var<storage, read> bias: array<f32>;
@group(0) @binding(4) var<storage, read> residual: array<f32>;
@group(0) @binding(5) var<storage, read> residual2: array<f32>;
@group(0) @binding(6) var<storage, read_write> y: array<f32>;

fn bias4(column: u32) -> vec4<f32> {
    var v = vec4<f32>(0.0);
    if ((p.flags & HAS_BIAS) != 0u) {
        for (var i = 0u; i < 4u; i++) {
            if (column + i < p.co) {
                v[i] = bias[column + i];
            }
        }
    }
    return v;
}

fn finish(sum: vec4<f32>, pixel: u32, column: u32) {
    if (pixel >= p.pixels) {
        return;
    }
    let v = lib_activate(sum + bias4(column), p.act);
    for (var i = 0u; i < 4u; i++) {
        if (column + i < p.co) {
            let at = p.y_rest + pixel * p.co + column + i;
            var out = v[i];
            if ((p.flags & HAS_RESIDUAL) != 0u) {
                out += residual[at];
            }
            if ((p.flags & HAS_RESIDUAL2) != 0u) {
                out += residual2[at];
            }
            y[at] = out;
        }
    }
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let tile = lib_fold(group, groups) * 64u + local.x;
    let columns = p.blocks * 8u;
    let column4 = tile % columns;
    let pixel = tile / columns * 4u;
    let column = p.n0 + column4 * 4u;
    if (pixel >= p.pixels || column >= p.co) {
        return;
    }
    let block = column4 / 8u;
    let lane = column4 % 8u;
#for i in 0..4
    // Pixels past the end read the last one; they are not written.
    let at$i = lib_place(min(pixel + ${i}u, p.pixels - 1u));
    var c$i = vec4<f32>(0.0);
#end
    var k = 0u;
    for (var tap = 0u; tap < p.taps; tap++) {
        let ky = tap / p.kw;
        let kx = tap - ky * p.kw;
#for i in 0..4
        let on$i = lib_on_map(at$i, ky, kx);
        // Taps outside read the window's start, and the value is replaced.
        let x$i = select(p.x_rest, lib_tap(at$i, ky, kx), on$i);
#end
        for (var c = 0u; c < p.ci; c++) {
            let b = lib_weight(block, k, lane);
#for i in 0..4
            c$i = fma(vec4<f32>(select(0.0, max(x[x$i + c], p.low), on$i)), b, c$i);
#end
            k++;
        }
    }
#for i in 0..4
    finish(c$i, pixel + ${i}u, column);
#end
}
