//! How results are compared: error relative in norm, and nothing non-finite unless expected.

/// `|got - want| / |want|` in the Euclidean norm (absolute where `want` is all zero); infinite when
/// lengths differ or one is finite where the other is not.
#[must_use]
pub fn relative_error(got: &[f32], want: &[f32]) -> f64 {
    if got.len() != want.len() {
        return f64::INFINITY;
    }
    let (mut error, mut norm) = (0.0f64, 0.0f64);
    for (&g, &w) in got.iter().zip(want) {
        let (g, w) = (f64::from(g), f64::from(w));
        if g.is_finite() && w.is_finite() {
            error += (g - w) * (g - w);
            norm += w * w;
        } else if !(g == w || (g.is_nan() && w.is_nan())) {
            return f64::INFINITY;
        }
    }
    if norm > 0.0 { (error / norm).sqrt() } else { error.sqrt() }
}

/// Asserts that `got` is within `limit` of `want`, relative in norm; says where the worst element is.
///
/// # Panics
/// When it is not.
#[track_caller]
pub fn assert_close(what: &str, got: &[f32], want: &[f32], limit: f64) {
    let error = relative_error(got, want);
    if error <= limit {
        return;
    }
    assert_eq!(got.len(), want.len(), "{what}: length");
    let difference = |i: usize| {
        let d = f64::from(got[i] - want[i]).abs();
        if d.is_nan() { f64::INFINITY } else { d }
    };
    let worst = (0..got.len()).max_by(|a, b| difference(*a).total_cmp(&difference(*b))).unwrap_or(0);
    panic!(
        "{what}: relative error {error:.3e} > {limit:.1e}; worst at {worst}: got {}, want {}",
        got[worst], want[worst]
    );
}

/// `values` as f16 holds them.
#[must_use]
pub fn as_f16(values: &[f32]) -> Vec<f32> {
    values.iter().map(|v| half::f16::from_f32(*v).to_f32()).collect()
}
