//! Similarities between two sets of cameras (`spec/da3.md` 8.4, 8.5).

use glam::{DMat3, DVec3};
use nalgebra::Matrix3 as NMatrix3;

use crate::GeometryError;
use crate::pose::{Pose, Rigid, to_rows};
use crate::random::Generator;
use crate::unproject::expect_length;

/// Views from which on the fit rejects outliers.
const RANSAC_VIEWS: usize = 10;
const RANSAC_ROUNDS: usize = 10;
const RANSAC_SEED: u32 = 42;
/// Second singular value of a covariance, relative to the first, below which centres count as collinear. Centres read as f32
/// carry relative errors of 1e-7, a straight path with jitter of 1e-4 has 1e-8.
const RANK_TOLERANCE: f64 = 1e-9;

/// `y = scale * rotation * x + translation`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Similarity {
    /// Positive factor.
    pub scale: f64,
    /// Three rows; determinant +1.
    pub rotation: [[f64; 3]; 3],
    /// In the unit of y.
    pub translation: [f64; 3],
}

impl Similarity {
    /// Maps every point to itself.
    pub const IDENTITY: Self =
        Self { scale: 1.0, rotation: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], translation: [0.0; 3] };

    /// This similarity after `first`.
    #[must_use]
    pub fn after(&self, first: &Self) -> Self {
        Self {
            scale: self.scale * first.scale,
            rotation: rows(self.matrix() * first.matrix()),
            translation: self.map(DVec3::from(first.translation)).to_array(),
        }
    }

    /// The way back.
    #[must_use]
    pub fn inverse(&self) -> Self {
        let (scale, rotation) = (1.0 / self.scale, self.matrix().transpose());
        let translation = (rotation * DVec3::from(self.translation) * -scale).to_array();
        Self { scale, rotation: rows(rotation), translation }
    }

    /// Maps a point.
    #[must_use]
    pub fn apply(&self, point: [f32; 3]) -> [f32; 3] {
        self.map(DVec3::from(point.map(f64::from))).as_vec3().to_array()
    }

    /// Maps a camera, w2c in and out: the c2w rotation becomes `R R_i`, the centre `s R c_i + t`.
    #[must_use]
    pub fn apply_to_w2c(&self, w2c: &Pose) -> Pose {
        let c2w = Rigid::from_rows(w2c).inverse();
        let mapped = Rigid { rotation: self.matrix() * c2w.rotation, translation: self.map(c2w.translation) };
        to_rows(mapped.inverse())
    }

    fn map(&self, point: DVec3) -> DVec3 {
        self.matrix() * point * self.scale + DVec3::from(self.translation)
    }

    fn matrix(&self) -> DMat3 {
        DMat3::from_cols_array_2d(&self.rotation).transpose()
    }
}

/// The rows of a matrix.
fn rows(matrix: DMat3) -> [[f64; 3]; 3] {
    matrix.transpose().to_cols_array_2d()
}

/// Which frame and scale the cameras and depths of a result are in when cameras were given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum AlignTo {
    /// The given cameras': predicted depth is divided by the scale. The reference's default.
    Given,
    /// The prediction's: the given cameras are moved, depth stays.
    Predicted,
}

/// Given cameras and predicted depth brought together.
#[derive(Debug, Clone, PartialEq)]
pub struct Alignment {
    /// From the given cameras' world to the predicted one.
    pub similarity: Similarity,
    /// The w2c poses of the result.
    pub extrinsics: Vec<Pose>,
    /// What predicted depth is to be divided by.
    pub depth_divisor: f64,
}

/// Brings given cameras (w2c) and the prediction's together (`spec/da3.md` 8.4).
///
/// # Errors
/// As [`fit_cameras`].
pub fn align_cameras(given: &[Pose], predicted: &[Pose], to: AlignTo) -> Result<Alignment, GeometryError> {
    let similarity = fit_cameras(given, predicted)?;
    Ok(match to {
        AlignTo::Given => Alignment { similarity, extrinsics: given.to_vec(), depth_divisor: similarity.scale },
        AlignTo::Predicted => Alignment {
            similarity,
            extrinsics: given.iter().map(|pose| similarity.apply_to_w2c(pose)).collect(),
            depth_divisor: 1.0,
        },
    })
}

/// How far given cameras and predicted ones are apart, once a similarity has brought them together. Pairs are median and largest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Agreement {
    /// Length in the predicted world of a unit of the given one.
    pub scale: f64,
    /// Angles between the two cameras of a view, in degrees.
    pub turned: [f64; 2],
    /// Distances between the two centres of a view, in parts of the largest distance of a given centre from their mean.
    pub moved: [f64; 2],
}

/// Compares given cameras (w2c), moved by the similarity that [`align_cameras`] found, with the predicted ones. None for no cameras.
#[must_use]
pub fn agreement(given: &[Pose], predicted: &[Pose], similarity: &Similarity) -> Option<Agreement> {
    let moved: Vec<Rigid> =
        given.iter().map(|pose| Rigid::from_rows(&similarity.apply_to_w2c(pose)).inverse()).collect();
    let predicted: Vec<Rigid> = predicted.iter().map(|pose| Rigid::from_rows(pose).inverse()).collect();
    let mean = moved.iter().map(|c| c.translation).sum::<DVec3>() / moved.len().max(1) as f64;
    let extent = moved.iter().map(|c| c.translation.distance(mean)).fold(0.0, f64::max);
    let pairs = || moved.iter().zip(&predicted);
    let angle = |(a, b): (&Rigid, &Rigid)| {
        let turn = a.rotation.transpose() * b.rotation;
        ((turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
    };
    let both = |mut values: Vec<f64>| {
        values.sort_by(f64::total_cmp);
        Some([*values.get(values.len() / 2)?, *values.last()?])
    };
    Some(Agreement {
        scale: similarity.scale,
        turned: both(pairs().map(angle).collect())?,
        moved: both(pairs().map(|(a, b)| a.translation.distance(b.translation) / extent).collect())?,
    })
}

/// The similarity from the given cameras' centres to the predicted ones' (w2c poses both).
///
/// With 10 views or more, outliers are rejected as in `spec/da3.md` 8.4: 10 draws of `max(3, (N+1)/2)` views by NumPy's
/// `default_rng(42)` (the same draws, bit for bit), inliers at most as far off as the median distance of plainly fitted
/// centres to the nearest predicted one, most inliers then least mean inlier error, refit on those inliers if at least 3.
///
/// # Errors
/// Fewer than 3 views, lists of different length, poses that are not finite, or collinear centres.
pub fn fit_cameras(given: &[Pose], predicted: &[Pose]) -> Result<Similarity, GeometryError> {
    let (x, y) = (centres(given)?, centres(predicted)?);
    if x.len() < RANSAC_VIEWS { umeyama(&x, &y) } else { ransac(&x, &y) }
}

/// Umeyama's least-squares similarity from points x to points y (`spec/da3.md` 8.5).
///
/// `cov = (1/n) sum (y - my)(x - mx)^T = U D V^T`, `R = U diag(1, 1, +-1) V^T` with the sign of `det U det V`,
/// `s = tr(D Sg)/var_x`, `t = my - s R mx`.
///
/// # Errors
/// Fewer than 3 points, lists of different length, or a covariance of rank below 2.
pub fn umeyama(x: &[[f64; 3]], y: &[[f64; 3]]) -> Result<Similarity, GeometryError> {
    expect_length("predicted cameras", x.len(), y.len())?;
    if x.len() < 3 {
        return Err(GeometryError::TooFewViews { views: x.len() });
    }
    let n = x.len() as f64;
    let mean = |points: &[[f64; 3]]| points.iter().map(|&p| DVec3::from(p)).sum::<DVec3>() / n;
    let (mx, my) = (mean(x), mean(y));
    let (mut cov, mut cov_x) = (NMatrix3::zeros(), NMatrix3::zeros());
    for (&x, &y) in x.iter().zip(y) {
        let (dx, dy) = (vector(DVec3::from(x) - mx), vector(DVec3::from(y) - my));
        cov += dy * dx.transpose() / n;
        cov_x += dx * dx.transpose() / n;
    }
    let (Some((u, d, vt)), Some((_, dx, _))) = (svd(cov), svd(cov_x)) else {
        return Err(GeometryError::InvalidCamera { view: 0, reason: "a camera centre has a NaN or infinity" });
    };
    if d[1] <= RANK_TOLERANCE * d[0] {
        // The variance of x alone squares the relative extent.
        let which = if dx[1] > RANK_TOLERANCE * dx[0] { "predicted" } else { "given" };
        return Err(GeometryError::CollinearCentres { which });
    }
    let sign = if u.determinant() * vt.determinant() < 0.0 { -1.0 } else { 1.0 };
    let rotation = u * NMatrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * vt;
    let scale = (d[0] + d[1] + sign * d[2]) / cov_x.trace();
    let mut similarity = Similarity {
        scale,
        rotation: std::array::from_fn(|i| std::array::from_fn(|j| rotation[(i, j)])),
        translation: [0.0; 3],
    };
    similarity.translation = (my - similarity.map(mx)).to_array();
    Ok(similarity)
}

fn ransac(x: &[[f64; 3]], y: &[[f64; 3]]) -> Result<Similarity, GeometryError> {
    let plain = umeyama(x, y)?;
    let nearest = x.iter().map(|&p| {
        let p = plain.map(DVec3::from(p));
        y.iter().map(|&q| p.distance(DVec3::from(q))).fold(f64::INFINITY, f64::min)
    });
    let threshold = median(nearest.collect());
    let pick = |list: &[[f64; 3]], places: &[usize]| -> Vec<[f64; 3]> { places.iter().map(|&k| list[k]).collect() };
    let mut generator = Generator::new(RANSAC_SEED);
    let mut best: Option<(Similarity, Vec<usize>, f64)> = None;
    for _ in 0..RANSAC_ROUNDS {
        let sample = generator.choice(x.len(), 3.max(x.len().div_ceil(2)));
        // A collinear sample says nothing; the next may.
        let Ok(fit) = umeyama(&pick(x, &sample), &pick(y, &sample)) else {
            continue;
        };
        let error = |k: usize| fit.map(DVec3::from(x[k])).distance(DVec3::from(y[k]));
        let inliers: Vec<usize> = (0..x.len()).filter(|&k| error(k) <= threshold).collect();
        let mean = inliers.iter().map(|&k| error(k)).sum::<f64>() / inliers.len().max(1) as f64;
        let better = best
            .as_ref()
            .is_none_or(|(_, most, least)| inliers.len() > most.len() || inliers.len() == most.len() && mean < *least);
        if better {
            best = Some((fit, inliers, mean));
        }
    }
    let Some((fit, inliers, _)) = best else {
        return Ok(plain);
    };
    if inliers.len() < 3 {
        return Ok(fit);
    }
    // Collinear inliers leave the sample's own fit, which was not.
    Ok(umeyama(&pick(x, &inliers), &pick(y, &inliers)).unwrap_or(fit))
}

/// The mean of the two middle values of an even number, as NumPy's.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    let n = values.len();
    (values[(n - 1) / 2] + values[n / 2]) / 2.0
}

fn centres(w2c: &[Pose]) -> Result<Vec<[f64; 3]>, GeometryError> {
    let centre = |(view, pose): (usize, &Pose)| {
        let centre = Rigid::from_rows(pose).inverse().translation;
        if centre.is_finite() {
            Ok(centre.to_array())
        } else {
            Err(GeometryError::InvalidCamera { view, reason: "its pose has a NaN or infinity" })
        }
    };
    w2c.iter().enumerate().map(centre).collect()
}

pub(crate) fn vector(v: DVec3) -> nalgebra::Vector3<f64> {
    nalgebra::Vector3::new(v.x, v.y, v.z)
}

pub(crate) type Svd3 = (NMatrix3<f64>, nalgebra::Vector3<f64>, NMatrix3<f64>);

/// U, descending singular values, V^T; none for a matrix that is not finite.
pub(crate) fn svd(matrix: NMatrix3<f64>) -> Option<Svd3> {
    if !matrix.iter().all(|v| v.is_finite()) {
        return None;
    }
    let svd = matrix.svd(true, true);
    Some((svd.u?, svd.singular_values, svd.v_t?))
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: Similarity = Similarity {
        scale: 2.5,
        rotation: [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]],
        translation: [1.0, -2.0, 3.0],
    };

    fn curve(n: usize) -> Vec<Pose> {
        let pose = |k: usize| {
            let a = k as f32 * 0.7;
            [[1.0, 0.0, 0.0, a.cos()], [0.0, 1.0, 0.0, (2.0 * a).sin()], [0.0, 0.0, 1.0, 0.3 * a]]
        };
        (0..n).map(pose).collect()
    }

    #[test]
    fn a_similarity_is_recovered() {
        for n in [3, 6, 9, 10, 25] {
            let given = curve(n);
            let moved: Vec<Pose> = given.iter().map(|pose| TRUTH.apply_to_w2c(pose)).collect();
            let found = fit_cameras(&given, &moved).unwrap();
            assert!((found.scale - TRUTH.scale).abs() < 1e-5, "{n} {found:?}");
            for (a, b) in found.translation.iter().zip(TRUTH.translation) {
                assert!((a - b).abs() < 1e-5, "{n} {found:?}");
            }
        }
    }

    #[test]
    fn there_and_back_is_nowhere() {
        let round = TRUTH.after(&TRUTH.inverse());
        let numbers = |s: &Similarity| [s.rotation.as_flattened(), &s.translation, &[s.scale]].concat();
        for (a, b) in numbers(&round).iter().zip(numbers(&Similarity::IDENTITY)) {
            assert!((a - b).abs() < 1e-12, "{round:?}");
        }
        let twice = TRUTH.after(&TRUTH);
        assert_eq!(twice.apply([1.0, 2.0, 3.0]), TRUTH.apply(TRUTH.apply([1.0, 2.0, 3.0])));
    }

    #[test]
    fn outliers_are_rejected_from_ten_views_on() {
        let given = curve(20);
        let mut moved: Vec<Pose> = given.iter().map(|pose| TRUTH.apply_to_w2c(pose)).collect();
        moved[4][0][3] += 3.0;
        moved[11][2][3] -= 4.0;
        let robust = fit_cameras(&given, &moved).unwrap();
        let plain = umeyama(&centres(&given).unwrap(), &centres(&moved).unwrap()).unwrap();
        assert!((plain.scale - 2.5).abs() > 1e-2, "{plain:?}");
        assert!((robust.scale - 2.5).abs() < 1e-4, "{robust:?}");
    }

    #[test]
    fn mirrored_points_still_give_a_rotation() {
        let x = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
        let y = x.map(|[a, b, c]| [-a, b, c]);
        let found = umeyama(&x, &y).unwrap();
        assert!((found.matrix().determinant() - 1.0).abs() < 1e-9);
    }

    #[test]
    fn degenerate_cameras_are_errors() {
        let line: Vec<Pose> =
            (0..5).map(|k| [[1.0, 0.0, 0.0, k as f32], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]).collect();
        let given = |a: &[Pose], b: &[Pose]| fit_cameras(a, b).unwrap_err();
        assert_eq!(given(&line, &curve(5)), GeometryError::CollinearCentres { which: "given" });
        assert_eq!(given(&curve(5), &line), GeometryError::CollinearCentres { which: "predicted" });
        assert_eq!(given(&curve(1), &curve(1)), GeometryError::TooFewViews { views: 1 });
        assert!(matches!(given(&curve(4), &curve(5)), GeometryError::LengthMismatch { .. }));
        let mut bad = curve(5);
        bad[2][0][3] = f32::NAN;
        assert!(matches!(given(&bad, &curve(5)), GeometryError::InvalidCamera { view: 2, .. }));
    }

    #[test]
    fn aligning_to_the_given_cameras_divides_depth() {
        let given = curve(5);
        let moved: Vec<Pose> = given.iter().map(|pose| TRUTH.apply_to_w2c(pose)).collect();
        let kept = align_cameras(&given, &moved, AlignTo::Given).unwrap();
        assert_eq!(kept.extrinsics, given);
        assert!((kept.depth_divisor - 2.5).abs() < 1e-5);
        let carried = align_cameras(&given, &moved, AlignTo::Predicted).unwrap();
        assert_eq!(carried.depth_divisor, 1.0);
        for (a, b) in carried.extrinsics.iter().flatten().flatten().zip(moved.iter().flatten().flatten()) {
            assert!((a - b).abs() < 1e-5);
        }
    }

    #[test]
    fn agreement_is_what_the_similarity_leaves() {
        let given = curve(8);
        let mut predicted: Vec<Pose> = given.iter().map(|pose| TRUTH.apply_to_w2c(pose)).collect();
        let exact = agreement(&given, &predicted, &TRUTH).unwrap();
        assert!(exact.turned[1] < 0.1 && exact.moved[1] < 1e-5 && exact.scale == TRUTH.scale, "{exact:?}");
        // One camera turned on the spot by 90 degrees about its own axis, so that its centre stays.
        let [x, y, z] = predicted[3];
        predicted[3] = [y.map(|v| -v), x, z];
        let one = agreement(&given, &predicted, &TRUTH).unwrap();
        assert!(one.turned[0] < 0.1 && (one.turned[1] - 90.0).abs() < 0.1 && one.moved[1] < 1e-5, "{one:?}");
        // Another moved by its own extent and more.
        predicted[5][0][3] += 100.0;
        assert!(agreement(&given, &predicted, &TRUTH).unwrap().moved[1] > 1.0);
        assert_eq!(agreement(&[], &[], &TRUTH), None);
    }
}
