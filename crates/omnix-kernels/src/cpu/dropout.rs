//! Oracle of `dropout`.

use crate::dropout::Dropout;

/// triple32 of hash-prospector: three rounds of shift and multiply.
fn hash(v: u32) -> u32 {
    let round = |h: u32, shift: u32, factor: u32| (h ^ h >> shift).wrapping_mul(factor);
    let h = round(round(round(v, 17, 0xed5a_d4bb), 11, 0xac4c_1b51), 15, 0x3184_8bab);
    h ^ h >> 14
}

/// `x / (1 − p)`, or 0 where the hash of (seed, step, stream, i) is below p · 2³².
#[must_use]
pub fn dropout(spec: &Dropout, step: u32, x: &[f32]) -> Vec<f32> {
    let drawn =
        [(spec.seed >> 32) as u32, step, spec.stream].into_iter().fold(hash(spec.seed as u32), |h, v| hash(h ^ v));
    let limit = f64::from(spec.p) * 2f64.powi(32);
    let number = |(i, v): (usize, &f32)| {
        if f64::from(hash(drawn ^ i as u32)) < limit.floor() { 0.0 } else { v * spec.scale() }
    };
    x.iter().enumerate().map(number).collect()
}
