//! Oracle of `swiglu_grad`.

use crate::cpu::pointwise::{unary, unary_slope};
use crate::pointwise::Unary;

/// dx `[m, 2h]` of `y = silu(a) · b`, x `[m, 2h]` and dy `[m, h]`.
#[must_use]
pub fn swiglu_grad((m, h): (usize, usize), x: &[f32], dy: &[f32]) -> Vec<f32> {
    let mut dx = vec![0.0; m * 2 * h];
    for row in 0..m {
        for j in 0..h {
            let (at, value) = (row * 2 * h + j, row * 2 * h + h + j);
            let (a, b, g) = (f64::from(x[at]), f64::from(x[value]), f64::from(dy[row * h + j]));
            dx[at] = (g * b * unary_slope(Unary::Silu, a)) as f32;
            dx[value] = (g * unary(Unary::Silu, a)) as f32;
        }
    }
    dx
}
