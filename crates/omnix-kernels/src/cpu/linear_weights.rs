//! Oracle of `linear_weights`.

/// `dw[n, k] = Σ_m dy[m, n] · x[m, k]` and `db[n] = Σ_m dy[m, n]`, in f64.
#[must_use]
pub fn linear_weights((m, n, k): (usize, usize, usize), x: &[f32], dy: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let mut dw = vec![0.0f64; n * k];
    let mut db = vec![0.0f64; n];
    for row in 0..m {
        for i in 0..n {
            let d = f64::from(dy[row * n + i]);
            db[i] += d;
            for j in 0..k {
                dw[i * k + j] += d * f64::from(x[row * k + j]);
            }
        }
    }
    let round = |sums: Vec<f64>| sums.into_iter().map(|v| v as f32).collect();
    (round(dw), round(db))
}
