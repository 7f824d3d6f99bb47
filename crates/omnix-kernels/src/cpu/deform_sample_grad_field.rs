//! Oracle of `deform_sample_grad_field`.

use crate::cpu::deform_sample::Sampled;
use crate::cpu::deform_sample_grad::deform_sample_grad;
use crate::deform_sample::DeformSample;

/// dfield `[levels, T, L, 9]` and dmask `[L]` for dtau `[n, 9 T + 1]`.
#[must_use]
pub fn deform_sample_grad_field(spec: &DeformSample, data: &Sampled<'_>, dtau: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let all = deform_sample_grad(spec, data, dtau);
    (all.field, all.mask)
}
