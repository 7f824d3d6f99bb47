//! Cameras from ray maps (`spec/da3.md` section 9): a homography by RANSAC, split into rotation and intrinsics.
//!
//! Differences from the reference, both towards less noise: least-squares systems are solved through their 9x9 normal matrix
//! in f64, and where a view has more than 8000 inliers the refit takes the whole top 95 % by weight instead of 8000
//! random ones of it. The factorisation into rotation and a *lower* triangular matrix is the reference's and is biased
//! for principal points off the centre.

use glam::DVec3;
use nalgebra::{Matrix3 as NMatrix3, SMatrix, SVector, SymmetricEigen};

use crate::GeometryError;
use crate::camera::Camera;
use crate::pose::{Pose, Rigid, to_rows};
use crate::random::Generator;
use crate::unproject::expect_length;

/// Directions with a smaller z take no part.
const MIN_DEPTH_DIRECTION: f32 = 1e-4;
/// Rounds of a table drawn here, and its seed.
const ROUNDS: usize = 100;
const SEED: u32 = 42;
/// Inliers are nearer than this to their target, in units of the normalised image plane.
const INLIER_DISTANCE: f64 = 0.2;
/// Inliers above which the refit leaves out the least weights.
const MAX_INLIERS: usize = 8000;

/// Ray maps of some views.
#[derive(Debug, Clone, Copy)]
pub struct RayMaps<'a> {
    /// `[views, height, width, 6]`: direction (any length), then origin, in world coordinates.
    pub rays: &'a [f32],
    /// `[views, height, width]`, not negative.
    pub confidence: &'a [f32],
    /// Height and width of the maps (8 times the patch grid).
    pub size: [usize; 2],
}

/// A camera found from a ray map.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RayCamera {
    /// Extrinsics w2c and intrinsics in pixels of the picture.
    pub camera: Camera,
    /// Camera to world.
    pub c2w: Pose,
    /// Focal lengths x and y where the picture is 2 x 2.
    pub focal: [f32; 2],
    /// Principal point where the picture is 2 x 2.
    pub principal: [f32; 2],
}

/// Solves the camera of every view from its rays; `image` is the picture's height and width in pixels.
///
/// `sample_table` holds 8 distinct ranks a round among the `max(8, 0.3 N)` rays of highest confidence (N rays a view), shared by
/// all views; without one, [`sample_table`] draws the same every time.
///
/// # Errors
/// Lists whose lengths do not belong together, a rank out of range, or a view whose rays determine no camera.
pub fn cameras_from_rays(
    maps: &RayMaps<'_>,
    image: [u32; 2],
    table: Option<&[[u32; 8]]>,
) -> Result<Vec<RayCamera>, GeometryError> {
    let count = maps.size[0] * maps.size[1];
    if count == 0 {
        return Err(GeometryError::DegenerateRays { view: 0, reason: "it is empty" });
    }
    let views = maps.confidence.len() / count;
    expect_length("ray confidence", views * count, maps.confidence.len())?;
    expect_length("ray maps", views * count * 6, maps.rays.len())?;
    if count < 8 {
        return Err(GeometryError::DegenerateRays { view: 0, reason: "it has fewer than 8 rays" });
    }
    let candidates = candidate_count(count);
    let own;
    let table = match table {
        Some(table) => table,
        None => {
            own = sample_table(count);
            &own
        }
    };
    if let Some(&rank) = table.iter().flatten().find(|&&rank| rank as usize >= candidates) {
        return Err(GeometryError::LengthMismatch {
            what: "rank in the sample table (of the candidates)",
            expected: candidates,
            found: rank as usize,
        });
    }
    let rays = maps.rays.as_chunks::<6>().0.chunks(count);
    let views = rays.zip(maps.confidence.chunks(count)).enumerate();
    views
        .map(|(view, (rays, confidence))| {
            solve_view(rays, confidence, maps.size, image, table)
                .map_err(|reason| GeometryError::DegenerateRays { view, reason })
        })
        .collect()
}

/// The rank table for maps of `rays` rays a view: 100 rounds of 8 distinct ranks, drawn as NumPy's `default_rng(42)` draws
/// `choice(candidates, 8, replace=False)`.
///
/// # Panics
/// With fewer than 8 rays.
#[must_use]
pub fn sample_table(rays: usize) -> Vec<[u32; 8]> {
    assert!(rays >= 8, "BUG: a sample table for {rays} rays");
    let candidates = candidate_count(rays);
    let mut generator = Generator::new(SEED);
    let mut round = || {
        let ranks = generator.choice(candidates, 8);
        std::array::from_fn(|k| ranks[k] as u32)
    };
    (0..ROUNDS).map(|_| round()).collect()
}

/// `max(8, floor(0.3 N))`, in whole numbers.
fn candidate_count(rays: usize) -> usize {
    (rays * 3 / 10).max(8)
}

/// A correspondence of the homography: q ~ H p, with a weight.
#[derive(Debug, Clone, Copy)]
struct Pair {
    p: [f64; 2],
    q: [f64; 2],
    weight: f64,
}

fn solve_view(
    rays: &[[f32; 6]],
    confidence: &[f32],
    [height, width]: [usize; 2],
    image: [u32; 2],
    table: &[[u32; 8]],
) -> Result<RayCamera, &'static str> {
    let pair = |(k, (ray, &weight)): (usize, (&[f32; 6], &f32))| {
        let (i, j) = (k / width, k % width);
        let centre = |k: usize, n: usize| (2 * k + 1) as f64 / n as f64 - 1.0;
        let [dx, dy, dz] = [ray[0], ray[1], ray[2]].map(f64::from);
        // A ray that is not finite, or weighs nothing or less, takes no part.
        let usable = ray.iter().all(|v| v.is_finite()) && ray[2].abs() > MIN_DEPTH_DIRECTION;
        let counts = usable && weight.is_finite() && weight > 0.0;
        Pair {
            p: [centre(j, width), centre(i, height)],
            q: if usable { [dx / dz, dy / dz] } else { [0.0; 2] },
            weight: if counts { f64::from(weight) } else { 0.0 },
        }
    };
    let pairs: Vec<Pair> = rays.iter().zip(confidence).enumerate().map(pair).collect();
    let total: f64 = pairs.iter().map(|pair| pair.weight).sum();
    if total <= 0.0 {
        return Err("no ray has a weight");
    }
    let homography = fit_homography(&pairs, table)?;
    let (rotation, lower) = split_homography(homography)?;
    let origins = rays.iter().zip(&pairs).filter(|(_, pair)| pair.weight > 0.0);
    let weighted = origins.map(|([.., x, y, z], pair)| DVec3::from([*x, *y, *z].map(f64::from)) * pair.weight);
    let c2w = Rigid { rotation, translation: weighted.sum::<DVec3>() / total };

    let focal = [1.0 / lower[(0, 0)], 1.0 / lower[(1, 1)]];
    let principal = [lower[(2, 0)] + 1.0, lower[(2, 1)] + 1.0];
    let half = [f64::from(image[1]) / 2.0, f64::from(image[0]) / 2.0];
    let [fx, fy, cx, cy] =
        [focal[0] * half[0], focal[1] * half[1], principal[0] * half[0], principal[1] * half[1]].map(|v| v as f32);
    Ok(RayCamera {
        camera: Camera {
            extrinsics: to_rows(c2w.inverse()),
            intrinsics: [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]],
        },
        c2w: to_rows(c2w),
        focal: focal.map(|v| v as f32),
        principal: principal.map(|v| v as f32),
    })
}

fn fit_homography(pairs: &[Pair], table: &[[u32; 8]]) -> Result<NMatrix3<f64>, &'static str> {
    let mut order: Vec<usize> = (0..pairs.len()).collect();
    // Stable: of equal weights the first pixel comes first.
    order.sort_by(|&a, &b| pairs[b].weight.total_cmp(&pairs[a].weight));
    let mut best: Option<(NMatrix3<f64>, f64)> = None;
    for ranks in table {
        let Some(h) = weighted_dlt(ranks.iter().map(|&rank| &pairs[order[rank as usize]])) else {
            continue;
        };
        let score = pairs.iter().filter(|pair| is_inlier(&h, pair)).map(|pair| pair.weight).sum();
        if best.as_ref().is_none_or(|(_, most)| score > *most) {
            best = Some((h, score));
        }
    }
    let Some((h, score)) = best else {
        return Err("no sample of 8 rays determines a homography");
    };
    if score <= 0.0 {
        return Err("no homography fits any rays");
    }
    let mut inliers: Vec<&Pair> = order.iter().map(|&k| &pairs[k]).filter(|pair| is_inlier(&h, pair)).collect();
    if inliers.len() > MAX_INLIERS {
        // In order of descending weight already.
        inliers.truncate((inliers.len() * 95 / 100).max(MAX_INLIERS));
    }
    weighted_dlt(inliers.into_iter()).ok_or("its inliers determine no homography")
}

fn is_inlier(h: &NMatrix3<f64>, pair: &Pair) -> bool {
    let [x, y] = pair.p;
    let row = |i: usize| h[(i, 0)] * x + h[(i, 1)] * y + h[(i, 2)];
    let z = row(2);
    let (du, dv) = (row(0) / z - pair.q[0], row(1) / z - pair.q[1]);
    // NaN compares false: out.
    du * du + dv * dv < INLIER_DISTANCE * INLIER_DISTANCE
}

/// The homography of least weighted algebraic error, last entry 1: the eigenvector of the least eigenvalue of the normal matrix of
/// the rows `sqrt(wt)(-x, -y, -1, 0, 0, 0, xu, yu, u)` and `sqrt(wt)(0, 0, 0, -x, -y, -1, xv, yv, v)`.
fn weighted_dlt<'a>(pairs: impl Iterator<Item = &'a Pair>) -> Option<NMatrix3<f64>> {
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for &Pair { p: [x, y], q: [u, v], weight } in pairs.filter(|pair| pair.weight > 0.0) {
        for row in [[-x, -y, -1.0, 0.0, 0.0, 0.0, x * u, y * u, u], [0.0, 0.0, 0.0, -x, -y, -1.0, x * v, y * v, v]] {
            let row = SVector::from(row);
            normal.ger(weight, &row, &row, 1.0);
        }
    }
    if !normal.iter().all(|v| v.is_finite()) {
        return None;
    }
    let eigen = SymmetricEigen::try_new(normal, f64::EPSILON, 1000)?;
    let vector = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let last = vector[8];
    let h = NMatrix3::from_fn(|i, j| vector[3 * i + j] / last);
    h.iter().all(|v| v.is_finite()).then_some(h)
}

/// `H = Q L`: Q a rotation, L lower triangular with a positive diagonal, divided by its last entry; H is negated first
/// where its determinant is negative.
fn split_homography(h: NMatrix3<f64>) -> Result<(glam::DMat3, NMatrix3<f64>), &'static str> {
    let h = if h.determinant() < 0.0 { -h } else { h };
    // With P the reversal of columns: H P = Q' R', so H = (Q' P)(P R' P), and P R' P is lower triangular.
    let reverse = |m: NMatrix3<f64>| NMatrix3::from_fn(|i, j| m[(i, 2 - j)]);
    let (q, r) = reverse(h).qr().unpack();
    let mut q = reverse(q);
    let mut lower = NMatrix3::from_fn(|i, j| r[(2 - i, 2 - j)]);
    for k in 0..3 {
        if lower[(k, k)] < 0.0 {
            lower.row_mut(k).neg_mut();
            q.column_mut(k).neg_mut();
        }
    }
    let smallest = lower.diagonal().min();
    if smallest <= 1e-12 * lower.norm() {
        return Err("its homography has no inverse");
    }
    lower /= lower[(2, 2)];
    Ok((glam::DMat3::from_cols_array_2d(&q.into()), lower))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rays of a camera with a central principal point.
    fn synthetic(size: [usize; 2], focal: [f64; 2], c2w: &Rigid) -> (Vec<f32>, Vec<f32>) {
        let mut rays = Vec::new();
        for i in 0..size[0] {
            for j in 0..size[1] {
                let x = (2 * j + 1) as f64 / size[1] as f64 - 1.0;
                let y = (2 * i + 1) as f64 / size[0] as f64 - 1.0;
                let d = c2w.rotation * DVec3::new(x / focal[0], y / focal[1], 1.0);
                rays.extend((d * 1.7).as_vec3().to_array());
                rays.extend(c2w.translation.as_vec3().to_array());
            }
        }
        (rays, vec![1.5; size[0] * size[1]])
    }

    fn pose() -> Rigid {
        let rotation = crate::pose::matrix_from_quaternion([0.1, -0.2, 0.05, 1.0]);
        Rigid { rotation, translation: DVec3::new(0.5, -1.0, 2.0) }
    }

    #[test]
    fn a_central_camera_is_recovered_by_the_own_table() {
        let (rays, confidence) = synthetic([16, 24], [1.6, 2.1], &pose());
        let maps = RayMaps { rays: &rays, confidence: &confidence, size: [16, 24] };
        let found = cameras_from_rays(&maps, [280, 504], None).unwrap();
        let k = found[0].camera.intrinsics;
        assert!((k[0][0] - 1.6 * 252.0).abs() < 1e-2 && (k[1][1] - 2.1 * 140.0).abs() < 1e-2, "{k:?}");
        assert!((k[0][2] - 252.0).abs() < 1e-2 && (k[1][2] - 140.0).abs() < 1e-2, "{k:?}");
        let expected = to_rows(pose());
        for (a, b) in found[0].c2w.iter().flatten().zip(expected.iter().flatten()) {
            assert!((a - b).abs() < 1e-5, "{found:?}");
        }
        assert_eq!(found, cameras_from_rays(&maps, [280, 504], None).unwrap());
    }

    #[test]
    fn many_inliers_need_no_random_draw() {
        let (mut rays, mut confidence) = synthetic([96, 112], [1.6, 2.1], &pose());
        // The least weights are dropped, so rays that are a little wrong, and inliers, change nothing there.
        for (ray, weight) in rays.chunks_mut(6).zip(&mut confidence).step_by(25) {
            ray[0] += 0.1;
            *weight = 1.4;
        }
        let maps = RayMaps { rays: &rays, confidence: &confidence, size: [96, 112] };
        let found = cameras_from_rays(&maps, [280, 504], None).unwrap();
        assert!((found[0].focal[0] - 1.6).abs() < 1e-4);
    }

    #[test]
    fn bad_rays_are_left_out_or_refused() {
        let (mut rays, mut confidence) = synthetic([8, 8], [1.0, 1.0], &pose());
        rays[6] = f32::NAN;
        rays[14] = 0.0;
        confidence[3] = f32::INFINITY;
        let maps = RayMaps { rays: &rays, confidence: &confidence, size: [8, 8] };
        let found = cameras_from_rays(&maps, [56, 56], None).unwrap();
        assert!((found[0].focal[0] - 1.0).abs() < 1e-4);

        let nothing = RayMaps { rays: &[0.0; 64 * 6], confidence: &[1.0; 64], size: [8, 8] };
        let error = cameras_from_rays(&nothing, [56, 56], None).unwrap_err();
        assert!(matches!(error, GeometryError::DegenerateRays { view: 0, .. }));
        let parallel: Vec<f32> = [0.0, 0.0, 1.0, 0.0, 0.0, 0.0].repeat(64);
        let flat = RayMaps { rays: &parallel, ..nothing };
        assert!(cameras_from_rays(&flat, [56, 56], None).is_err());
        let wrong = RayMaps { size: [8, 9], ..nothing };
        assert!(cameras_from_rays(&wrong, [56, 56], None).is_err());
        assert!(cameras_from_rays(&maps, [56, 56], Some(&[[19; 8]])).is_err());
    }

    #[test]
    fn the_factor_is_lower_triangular() {
        let h = NMatrix3::new(0.9, 0.1, 0.2, -0.3, 1.1, 0.4, 0.1, -0.2, 1.0);
        let (q, l) = split_homography(-h).unwrap();
        assert!((q.determinant() - 1.0).abs() < 1e-12);
        assert!(l[(0, 1)].abs() < 1e-12 && l[(0, 2)].abs() < 1e-12 && l[(1, 2)].abs() < 1e-12);
        let q = NMatrix3::from(q.to_cols_array_2d());
        let back = q * l;
        let ratio = h / h.norm() - back / back.norm();
        assert!(ratio.norm() < 1e-12, "{ratio}");
    }
}
