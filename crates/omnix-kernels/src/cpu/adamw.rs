//! Oracle of `adamw`.

use crate::adamw::AdamW;

/// Weights and both moments after one step, from the three before it.
#[must_use]
pub fn adamw(spec: &AdamW, state: [&[f32]; 3], gradient: &[f32], rates: &[f32], clip: &[f32]) -> [Vec<f32>; 3] {
    let [keep, rate, root] = [0, 1, 2].map(|i| f64::from(rates[i]));
    let factor = if spec.clip { clip[0] } else { spec.scale };
    let [beta1, beta2] = spec.betas;
    let mut new = state.map(<[f32]>::to_vec);
    if spec.clip && clip[2] != 0.0 {
        return new;
    }
    for i in 0..spec.n as usize {
        let [w, m, v] = state.map(|of| f64::from(of[i]));
        let g = f64::from(gradient[i]) * f64::from(factor);
        let m = beta1 * m + (1.0 - beta1) * g;
        let v = beta2 * v + (1.0 - beta2) * g * g;
        let w = keep * w - rate * m / (v.sqrt() / root + f64::from(spec.eps));
        for (to, value) in new.iter_mut().zip([w, m, v]) {
            to[i] = value as f32;
        }
    }
    new
}
