// resize, any WebGPU device: see lib/resize_params for the equation and the shapes.
//
// An invocation owns one element of y (one number, or four channels in the variants with VEC4). Bicubic
// is Keys' kernel with a = -0.75; taps outside of the map take the border's value.
//
// This is the GPU's variant too. Bilinear at twice the size moves 5 bytes a number to or from memory (1 read of 4 outputs,
// 4 bytes each, and 4 written) and reads 16 from L1, which delivers 8 to 20 times what memory does: memory bounds, at a
// tenth of an operation's time for 6 operations a number, and neighbouring invocations read neighbouring vec4. Workgroup memory
// or shuffles would move the same 16 bytes through the same unit and add a barrier; f16 could only round what is f32 in
// memory on both sides. Bicubic reads 64 bytes from L1 a number, but only for the position table. About 32
// registers, no workgroup memory: full occupancy.
#import resize_params
#import grid

#if VEC4
@group(0) @binding(1) var<storage, read> x: array<vec4<f32>>;
@group(0) @binding(2) var<storage, read> code: array<vec4<f32>>;
@group(0) @binding(3) var<storage, read_write> y: array<vec4<f32>>;
alias Value = vec4<f32>;
#else
@group(0) @binding(1) var<storage, read> x: array<f32>;
@group(0) @binding(2) var<storage, read> code: array<f32>;
@group(0) @binding(3) var<storage, read_write> y: array<f32>;
alias Value = f32;
#endif

// Element c of a pixel, the border's outside of the map.
fn tap(frame: u32, iy: i32, ix: i32, c: u32) -> Value {
    let row = frame * p.hi + u32(clamp(iy, 0, i32(p.hi) - 1)) - p.iy0;
    return x[p.x_rest + (row * p.wi + u32(clamp(ix, 0, i32(p.wi) - 1))) * p.c + c];
}

@compute @workgroup_size(64)
fn main(
    @builtin(local_invocation_id) local: vec3<u32>,
    @builtin(workgroup_id) group: vec3<u32>,
    @builtin(num_workgroups) groups: vec3<u32>,
) {
    let i = lib_fold(group, groups) * 64u + local.x;
    let pixel = i / p.c;
    if (pixel >= p.pixels) {
        return;
    }
    let c = i - pixel * p.c;
    let frame = pixel / p.frame_pixels;
    let inside = pixel - frame * p.frame_pixels;
    let row = inside / p.wo;
    let v = lib_coordinate(p.oy0 + row, p.y_a, p.y_b, p.y_d);
    let h = lib_coordinate(inside - row * p.wo, p.x_a, p.x_b, p.x_d);
#if CUBIC
    let wy = lib_cubic(v.fraction);
    let wx = lib_cubic(h.fraction);
    var sum = Value(0.0);
#for j in 0..4
    sum += wy[$j] * (wx.x * tap(frame, v.cell + ${j-1}, h.cell - 1, c) + wx.y * tap(frame, v.cell + ${j-1}, h.cell, c)
        + wx.z * tap(frame, v.cell + ${j-1}, h.cell + 1, c) + wx.w * tap(frame, v.cell + ${j-1}, h.cell + 2, c));
#end
#else
    let top = mix(tap(frame, v.cell, h.cell, c), tap(frame, v.cell, h.cell + 1, c), h.fraction);
    let bottom = mix(tap(frame, v.cell + 1, h.cell, c), tap(frame, v.cell + 1, h.cell + 1, c), h.fraction);
    var sum = mix(top, bottom, v.fraction);
#endif
    if (p.has_code != 0u) {
        let half = p.c / 2u;
        let column = inside - row * p.wo;
        sum += code[p.code_rest + select((p.wo + p.oy0 + row) * half + c - half, column * half + c, c < half)];
    }
    y[p.y_rest + i] = sum;
}
