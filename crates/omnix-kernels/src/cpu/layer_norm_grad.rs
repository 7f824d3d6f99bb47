//! Oracle of `layer_norm_grad`.

/// Gradients of x `[m, c]`, weight `[c]` and bias `[c]` of a layer norm, in f64; without `weight` it is 1.
#[must_use]
pub fn layer_norm_grad(
    (m, c): (usize, usize),
    x: &[f32],
    eps: f32,
    weight: Option<&[f32]>,
    dy: &[f32],
) -> (Vec<f32>, Vec<f32>, Vec<f32>) {
    let mut dx = vec![0.0; m * c];
    let mut d_weight = vec![0.0f64; c];
    let mut d_bias = vec![0.0f64; c];
    for row in 0..m {
        let x: Vec<f64> = x[row * c..(row + 1) * c].iter().map(|v| f64::from(*v)).collect();
        let mean = x.iter().sum::<f64>() / c as f64;
        let variance = x.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / c as f64;
        let deviation = (variance + f64::from(eps)).sqrt();
        let normal: Vec<f64> = x.iter().map(|v| (v - mean) / deviation).collect();
        let dy: Vec<f64> = dy[row * c..(row + 1) * c].iter().map(|v| f64::from(*v)).collect();
        let g: Vec<f64> = (0..c).map(|i| dy[i] * weight.map_or(1.0, |w| f64::from(w[i]))).collect();
        let plain = g.iter().sum::<f64>() / c as f64;
        let along = g.iter().zip(&normal).map(|(g, n)| g * n).sum::<f64>() / c as f64;
        for i in 0..c {
            dx[row * c + i] = ((g[i] - plain - normal[i] * along) / deviation) as f32;
            d_weight[i] += dy[i] * normal[i];
            d_bias[i] += dy[i];
        }
    }
    let round = |sums: Vec<f64>| sums.into_iter().map(|v| v as f32).collect();
    (dx, round(d_weight), round(d_bias))
}
