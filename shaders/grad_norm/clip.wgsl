// grad_norm, the factor that clips all gradients, from the sum of their squares [1]:
//
//   norm = sqrt(sum), clip = [scale min(1, max_norm / (norm + 1e-6)), norm, bad, 0]
//
// bad is 1 where the norm is NaN or infinite, else 0; then the factor is 0. Found by bits: compilers may take it that no number is.
#import grad_norm_params

@group(0) @binding(1) var<storage, read> sum: array<f32>;
@group(0) @binding(2) var<storage, read_write> clip: array<f32>;

@compute @workgroup_size(1)
fn main() {
    let norm = sqrt(sum[0]);
    let bad = (bitcast<u32>(sum[0]) & 0x7fffffffu) >= 0x7f800000u;
    let factor = p.scale * min(1.0, p.max_norm / (norm + 1e-6));
    clip[0] = select(factor, 0.0, bad);
    clip[1] = norm;
    clip[2] = select(0.0, 1.0, bad);
    clip[3] = 0.0;
}
