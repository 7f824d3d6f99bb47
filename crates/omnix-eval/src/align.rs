//! The similarity that brings estimated positions onto true ones (Umeyama 1991), with the conditions of the tool evo.
//!
//! `cov = (1/n) sum (y - my)(x - mx)^T = U D V^T`, `R = U diag(1, 1, sign(det U det V)) V^T`, `s = tr(D S)/var_x` (1 without scale),
//! `t = my - s R mx`. A covariance with fewer than two singular values above machine epsilon is refused, as evo refuses it. (The
//! fit of `omnix-geometry` is stricter: it compares with the largest singular value. Published numbers follow evo's rule.)

use glam::{DMat3, DVec3};
use nalgebra::{Matrix3, Vector3};
use serde::Serialize;

use crate::EvalError;

/// `y = scale * R x + t`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Similarity {
    /// Factor.
    pub scale: f64,
    /// R as three rows; determinant +1.
    pub rotation: [[f64; 3]; 3],
    /// t, in the unit of y.
    pub translation: [f64; 3],
}

impl Similarity {
    /// Nothing changes.
    pub const IDENTITY: Self =
        Self { scale: 1.0, rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// A change of scale alone.
    #[must_use]
    pub fn of_scale(scale: f64) -> Self {
        Self { scale, ..Self::IDENTITY }
    }

    /// Maps a point.
    #[must_use]
    pub fn apply(&self, point: [f64; 3]) -> [f64; 3] {
        let rotation = DMat3::from_cols_array_2d(&self.rotation).transpose();
        (rotation * DVec3::from(point) * self.scale + DVec3::from(self.translation)).to_array()
    }
}

/// The least-squares similarity from points x to points y; without `with_scale` the rigid motion.
///
/// # Errors
/// [`EvalError::Counts`] for lists of different length, [`EvalError::Degenerate`] where no rotation is determined or a position is NaN
/// or infinite.
pub fn umeyama(x: &[[f64; 3]], y: &[[f64; 3]], with_scale: bool) -> Result<Similarity, EvalError> {
    EvalError::expect("positions to align", x.len(), y.len())?;
    if x.is_empty() {
        return Err(EvalError::Degenerate { reason: "there are no positions" });
    }
    let n = x.len() as f64;
    let mean = |points: &[[f64; 3]]| points.iter().map(|&p| DVec3::from(p)).sum::<DVec3>() / n;
    let (mean_x, mean_y) = (mean(x), mean(y));
    let (mut covariance, mut variance) = (Matrix3::<f64>::zeros(), 0.0);
    for (&x, &y) in x.iter().zip(y) {
        let (dx, dy) = (DVec3::from(x) - mean_x, DVec3::from(y) - mean_y);
        covariance += vector(dy) * vector(dx).transpose();
        variance += dx.length_squared();
    }
    covariance /= n;
    variance /= n;
    if !covariance.iter().all(|v| v.is_finite()) {
        return Err(EvalError::Degenerate { reason: "a position is NaN or infinite" });
    }
    let svd = covariance.svd(true, true);
    let (Some(u), Some(vt)) = (svd.u, svd.v_t) else {
        return Err(EvalError::Degenerate { reason: "their covariance has no singular values" });
    };
    let d = svd.singular_values;
    if d.iter().filter(|&&value| value > f64::EPSILON).count() < 2 {
        return Err(EvalError::Degenerate { reason: "their covariance has a rank below 2" });
    }
    let sign = if u.determinant() * vt.determinant() < 0.0 { -1.0 } else { 1.0 };
    let rotation = u * Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, sign)) * vt;
    let scale = if with_scale { (d[0] + d[1] + sign * d[2]) / variance } else { 1.0 };
    let rows = std::array::from_fn(|i| std::array::from_fn(|j| rotation[(i, j)]));
    let turned = Similarity { scale, rotation: rows, translation: [0.0; 3] }.apply(mean_x.to_array());
    Ok(Similarity { scale, rotation: rows, translation: (mean_y - DVec3::from(turned)).to_array() })
}

fn vector(v: DVec3) -> Vector3<f64> {
    Vector3::new(v.x, v.y, v.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    const CORNERS: [[f64; 3]; 5] =
        [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0], [1.0, 1.0, -1.0]];

    #[test]
    fn a_known_similarity_is_found() {
        let (sin, cos) = 0.7f64.sin_cos();
        let truth = Similarity {
            scale: 2.5,
            rotation: [[cos, -sin, 0.0], [sin, cos, 0.0], [0.0, 0.0, 1.0]],
            translation: [1.0, -2.0, 0.5],
        };
        let moved = CORNERS.map(|p| truth.apply(p));
        let found = umeyama(&CORNERS, &moved, true).unwrap();
        let error = |found: &Similarity| {
            CORNERS
                .iter()
                .zip(&moved)
                .map(|(&p, &q)| DVec3::from(found.apply(p)).distance(DVec3::from(q)))
                .fold(0.0, f64::max)
        };
        assert!(error(&found) < 1e-12, "{found:?}");
        assert_eq!(umeyama(&CORNERS, &moved, false).unwrap().scale, 1.0);
    }

    #[test]
    fn a_mirror_is_not_a_rotation() {
        let mirrored = CORNERS.map(|[x, y, z]| [-x, y, z]);
        let found = umeyama(&CORNERS, &mirrored, true).unwrap();
        let determinant = DMat3::from_cols_array_2d(&found.rotation).determinant();
        assert!((determinant - 1.0).abs() < 1e-9, "{found:?}");
    }

    #[test]
    fn lines_points_and_nan_are_refused() {
        let line: Vec<[f64; 3]> = (0..6).map(|k| [f64::from(k), 2.0 * f64::from(k), 0.0]).collect();
        assert!(matches!(umeyama(&line, &line, true), Err(EvalError::Degenerate { .. })));
        assert!(matches!(umeyama(&[], &[], true), Err(EvalError::Degenerate { .. })));
        assert!(matches!(umeyama(&CORNERS, &CORNERS[..4], true), Err(EvalError::Counts { .. })));
        let mut bad = CORNERS;
        bad[2][1] = f64::NAN;
        assert!(matches!(umeyama(&bad, &CORNERS, true), Err(EvalError::Degenerate { .. })));
    }
}
