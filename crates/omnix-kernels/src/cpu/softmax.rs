//! Oracle of `softmax`.

/// Softmax over the last axis of `x[m, n]` in f64; a row of −∞ gives zeros.
#[must_use]
pub fn softmax((m, n): (usize, usize), x: &[f32]) -> Vec<f32> {
    let mut y = vec![0.0; m * n];
    for row in 0..m {
        let x = &x[row * n..(row + 1) * n];
        let top = x.iter().fold(f64::MIN, |top, v| top.max(f64::from(*v)));
        let sum: f64 = x.iter().map(|v| (f64::from(*v) - top).exp()).sum();
        for i in 0..n {
            if sum != 0.0 {
                y[row * n + i] = ((f64::from(x[i]) - top).exp() / sum) as f32;
            }
        }
    }
    y
}
