//! Two reconstructions that share images, brought into one world: scale first, then rotation and translation.
//!
//! Both reconstructions see the same pixels of the shared images, so every pixel is a pair of points. Used are pixels that both call
//! still, with depth in both, and of those in each image the surer [`SURE`]; each image gives at most [`SAMPLES`], evenly spread. Then
//!
//! 1. scale: the median of `ln(z_earlier / z_later)`, which neither cameras nor outliers reach;
//! 2. rotation and translation for that scale: weighted least squares of `|x_earlier - (s R x_later + t)| / z_earlier`, the
//!    distance in parts of the depth, because depth errs in proportion to itself. Weights are the pixels' confidences times
//!    `1 / (1 + (e/sigma)^2)^2` (Geman and McClure), sigma from the median of the distances e, for [`ROUNDS`] rounds. It starts
//!    from what is nearest among the motions that each shared image's two cameras say, and the plain fit, so that outliers in the
//!    points cannot lead it astray.
//!
//! Nothing is drawn at random. Whether the fit is good enough to join by is the caller's to say: [`Join`] states what it leaves.

use glam::{DMat3, DVec3};
use nalgebra::Matrix3 as NMatrix3;

use crate::GeometryError;
use crate::align::{Similarity, median, svd, vector};
use crate::camera::Camera;
use crate::pose::{Rigid, invert_pose};
use crate::unproject::{PixelCentre, expect_length, points_from_depth};

/// Points of one shared image at most.
const SAMPLES: usize = 4096;
/// The share of an image's still pixels that counts as sure.
const SURE: f64 = 0.7;
/// Rounds of weighting.
const ROUNDS: usize = 20;
/// Pairs below which nothing is fitted.
const FEWEST: usize = 32;
/// Second singular value of a covariance, relative to the first, below which points lie on a line.
const RANK_TOLERANCE: f64 = 1e-9;
/// Least sigma, in parts of the depth: what f32 leaves of equal points.
const LEAST_SIGMA: f64 = 1e-6;

/// One image as a reconstruction has it.
#[derive(Debug, Clone, Copy)]
pub struct Seen<'a> {
    /// Depth along the camera's z axis, `[height, width]`.
    pub depth: &'a [f32],
    /// Confidence of each depth, above 0; the larger the surer.
    pub confidence: &'a [f32],
    /// Whether each pixel stands still; none where that is not known, and then all count.
    pub still: Option<&'a [bool]>,
    /// The camera, world-to-camera.
    pub camera: Camera,
}

/// A pixel as a pair of points.
#[derive(Debug, Clone, Copy)]
struct Pair {
    earlier: DVec3,
    later: DVec3,
    /// Depths in the two cameras.
    depth: [f64; 2],
    weight: f64,
}

/// What two reconstructions say of the images that they share.
#[derive(Debug, Clone, Default)]
pub struct Shared {
    pairs: Vec<Pair>,
    /// Both cameras of each image, camera-to-world.
    cameras: Vec<[Rigid; 2]>,
    pixels: usize,
    still: usize,
}

/// How a reconstruction lies in the world of an earlier one, and what is left between the two.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Join {
    /// From the later world to the earlier one.
    pub similarity: Similarity,
    /// Images that both have.
    pub images: usize,
    /// Pairs of points that were used.
    pub points: usize,
    /// Share of the shared images' pixels that both call still.
    pub still: f64,
    /// Distance between the two points of a pixel in parts of its depth: median and 90th percentile.
    pub residual: [f64; 2],
    /// Median of `|ln(z_earlier / (s z_later))|`: what scale leaves.
    pub depth_residual: f64,
    /// Angle between the two cameras of an image in degrees: median and largest.
    pub turned: [f64; 2],
    /// Distance between their centres in parts of the median depth: median and largest.
    pub moved: [f64; 2],
}

/// Why nothing could be fitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum JoinError {
    /// There are no shared images.
    #[error("they share no images")]
    NoImages,
    /// Too few pixels stand still in both and have depth in both.
    #[error("only {points} of {pixels} pixels of the shared images stand still and have depth in both")]
    TooFewPoints {
        /// Pixels that do.
        points: usize,
        /// Pixels in all.
        pixels: usize,
    },
    /// The points lie on a line or at one point, or are not finite.
    #[error("the points that they share lie on one line, which fixes no rotation")]
    Degenerate,
}

impl Shared {
    /// Adds an image of `[height, width]` pixels as both have it.
    ///
    /// # Errors
    /// Maps of another length, or a camera that cannot be inverted.
    pub fn add(&mut self, size: [usize; 2], earlier: &Seen<'_>, later: &Seen<'_>) -> Result<(), GeometryError> {
        let pixels = size[0] * size[1];
        for seen in [earlier, later] {
            expect_length("depth map", pixels, seen.depth.len())?;
            expect_length("map of confidence", pixels, seen.confidence.len())?;
            expect_length("map of what is still", pixels, seen.still.map_or(pixels, <[bool]>::len))?;
        }
        let still = |k: usize| [earlier, later].iter().all(|seen| seen.still.is_none_or(|still| still[k]));
        let depth = |k: usize| [earlier.depth[k], later.depth[k]];
        let sound = |k: &usize| depth(*k).iter().all(|z| z.is_finite() && *z > 0.0);
        let weight = |k: usize| (f64::from(earlier.confidence[k]) * f64::from(later.confidence[k])).max(0.0).sqrt();
        self.pixels += pixels;
        self.still += (0..pixels).filter(|&k| still(k)).count();
        let mut usable: Vec<usize> =
            (0..pixels).filter(|&k| still(k)).filter(sound).filter(|&k| weight(k).is_finite()).collect();
        let mut weights: Vec<f64> = usable.iter().map(|&k| weight(k)).collect();
        weights.sort_unstable_by(f64::total_cmp);
        let least = weights.get(((1.0 - SURE) * weights.len() as f64) as usize).copied().unwrap_or(0.0);
        usable.retain(|&k| weight(k) >= least);
        let world = |seen: &Seen<'_>| {
            let c2w = invert_pose(&seen.camera.extrinsics);
            points_from_depth(seen.depth, size, &seen.camera.intrinsics, &c2w, PixelCentre::Whole)
        };
        let worlds = [world(earlier)?, world(later)?];
        let taken = usable.len().min(SAMPLES);
        for place in (0..taken).map(|j| usable[j * usable.len() / taken]) {
            let [a, b] = worlds.each_ref().map(|points| DVec3::from(points[place].map(f64::from)));
            if a.is_finite() && b.is_finite() {
                let depth = depth(place).map(f64::from);
                self.pairs.push(Pair { earlier: a, later: b, depth, weight: weight(place) });
            }
        }
        self.cameras.push([earlier, later].map(|seen| Rigid::from_rows(&seen.camera.extrinsics).inverse()));
        Ok(())
    }

    /// Fits the later world to the earlier one.
    ///
    /// # Errors
    /// No images, too few still points with depth, or points that fix no rotation.
    pub fn fit(&self) -> Result<Join, JoinError> {
        if self.cameras.is_empty() {
            return Err(JoinError::NoImages);
        }
        if self.pairs.len() < FEWEST {
            return Err(JoinError::TooFewPoints { points: self.pairs.len(), pixels: self.pixels });
        }
        let ratios = self.pairs.iter().map(|pair| (pair.depth[0] / pair.depth[1]).ln());
        let scale = median(ratios.collect()).exp();
        let mut motion = self.start(scale)?;
        for _ in 0..ROUNDS {
            let distances = self.distances(scale, motion);
            let sigma = (1.4826 * median(distances.clone())).max(LEAST_SIGMA);
            let pull = |e: &f64| 1.0 / (1.0 + (e / sigma).powi(2)).powi(2);
            motion = self.least_squares(scale, distances.iter().map(pull)).ok_or(JoinError::Degenerate)?;
        }
        Ok(self.describe(scale, motion))
    }

    /// The nearest of the motions that cameras say, and the plain fit.
    fn start(&self, scale: f64) -> Result<Rigid, JoinError> {
        let plain = self.least_squares(scale, std::iter::repeat(1.0)).ok_or(JoinError::Degenerate)?;
        let of_cameras = self.cameras.iter().map(|[earlier, later]| {
            let rotation = earlier.rotation * later.rotation.transpose();
            Rigid { rotation, translation: earlier.translation - rotation * later.translation * scale }
        });
        let judged = of_cameras.chain([plain]).map(|motion| (median(self.distances(scale, motion)), motion));
        let best = judged.filter(|(far, _)| far.is_finite()).min_by(|(a, _), (b, _)| a.total_cmp(b));
        best.map(|(_, motion)| motion).ok_or(JoinError::Degenerate)
    }

    /// Of every pair, in parts of the depth.
    fn distances(&self, scale: f64, motion: Rigid) -> Vec<f64> {
        let distance = |pair: &Pair| {
            let moved = motion.rotation * pair.later * scale + motion.translation;
            pair.earlier.distance(moved) / pair.depth[0]
        };
        self.pairs.iter().map(distance).collect()
    }

    /// The motion of least weighted squares (Kabsch); none where points fix no rotation.
    fn least_squares(&self, scale: f64, pull: impl Iterator<Item = f64>) -> Option<Rigid> {
        let weights: Vec<f64> =
            self.pairs.iter().zip(pull).map(|(pair, pull)| pair.weight * pull / pair.depth[0].powi(2)).collect();
        let total: f64 = weights.iter().sum();
        let mean = |of: &dyn Fn(&Pair) -> DVec3| {
            self.pairs.iter().zip(&weights).map(|(pair, w)| of(pair) * *w).sum::<DVec3>() / total
        };
        let (mean_a, mean_b) = (mean(&|pair| pair.earlier), mean(&|pair| pair.later * scale));
        let mut covariance = NMatrix3::zeros();
        for (pair, weight) in self.pairs.iter().zip(&weights) {
            let (a, b) = (vector(pair.earlier - mean_a), vector(pair.later * scale - mean_b));
            covariance += a * b.transpose() * (*weight / total);
        }
        let (u, d, vt) = svd(covariance)?;
        if d[1] <= RANK_TOLERANCE * d[0] {
            return None;
        }
        let sign = if u.determinant() * vt.determinant() < 0.0 { -1.0 } else { 1.0 };
        let r = u * NMatrix3::from_diagonal(&nalgebra::Vector3::new(1.0, 1.0, sign)) * vt;
        let rows: [[f64; 3]; 3] = std::array::from_fn(|i| std::array::from_fn(|j| r[(i, j)]));
        let rotation = DMat3::from_cols_array_2d(&rows).transpose();
        Some(Rigid { rotation, translation: mean_a - rotation * mean_b })
    }

    fn describe(&self, scale: f64, motion: Rigid) -> Join {
        let mut distances = self.distances(scale, motion);
        distances.sort_unstable_by(f64::total_cmp);
        let at = |share: f64| distances[((distances.len() - 1) as f64 * share) as usize];
        let left = self.pairs.iter().map(|pair| (pair.depth[0] / (scale * pair.depth[1])).ln().abs());
        let depth = median(self.pairs.iter().map(|pair| pair.depth[0]).collect());
        let both = |mut values: Vec<f64>| {
            values.sort_unstable_by(f64::total_cmp);
            [values[values.len() / 2], values[values.len() - 1]]
        };
        let turned = self.cameras.iter().map(|[earlier, later]| {
            let turn = earlier.rotation.transpose() * motion.rotation * later.rotation;
            ((turn.x_axis.x + turn.y_axis.y + turn.z_axis.z - 1.0) / 2.0).clamp(-1.0, 1.0).acos().to_degrees()
        });
        let moved = self.cameras.iter().map(|[earlier, later]| {
            let centre = motion.rotation * later.translation * scale + motion.translation;
            earlier.translation.distance(centre) / depth
        });
        Join {
            similarity: Similarity {
                scale,
                rotation: motion.rotation.transpose().to_cols_array_2d(),
                translation: motion.translation.to_array(),
            },
            images: self.cameras.len(),
            points: self.pairs.len(),
            still: self.still as f64 / self.pixels.max(1) as f64,
            residual: [at(0.5), at(0.9)],
            depth_residual: median(left.collect()),
            turned: both(turned.collect()),
            moved: both(moved.collect()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;

    const SIZE: [usize; 2] = [24, 32];
    const PIXELS: usize = SIZE[0] * SIZE[1];
    const TRUTH: Similarity = Similarity {
        scale: 2.5,
        rotation: [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]],
        translation: [1.0, -2.0, 3.0],
    };

    /// A camera that looks at a bumpy wall, and the depth that it sees.
    fn view(k: usize) -> (Camera, Vec<f32>) {
        let turn = 0.05 * k as f64;
        let (sin, cos) = turn.sin_cos();
        let extrinsics: Pose = [[cos, 0.0, sin, 0.1 * k as f64], [0.0, 1.0, 0.0, -0.2], [-sin, 0.0, cos, 0.3]]
            .map(|row| row.map(|v| v as f32));
        let intrinsics = [[30.0, 0.0, 16.0], [0.0, 31.0, 12.0], [0.0, 0.0, 1.0]];
        let depth = |p: usize| {
            let (x, y) = ((p % SIZE[1]) as f32, (p / SIZE[1]) as f32);
            4.0 + 0.1 * x + 0.05 * y + (0.7 * x + k as f32).sin() * (0.5 * y).cos()
        };
        (Camera { extrinsics, intrinsics }, (0..PIXELS).map(depth).collect())
    }

    /// The same view in the world whose similarity to this one is `truth`.
    fn elsewhere(camera: &Camera, depth: &[f32], truth: &Similarity) -> (Camera, Vec<f32>) {
        let back = truth.inverse();
        let extrinsics = back.apply_to_w2c(&camera.extrinsics);
        (Camera { extrinsics, ..*camera }, depth.iter().map(|z| (f64::from(*z) * back.scale) as f32).collect())
    }

    fn near(found: &Similarity, truth: &Similarity, bound: f64) -> bool {
        let numbers = |s: &Similarity| {
            [s.scale].into_iter().chain(s.rotation.into_iter().flatten()).chain(s.translation).collect::<Vec<f64>>()
        };
        numbers(found).iter().zip(numbers(truth)).all(|(a, b)| (a - b).abs() < bound)
    }

    /// Joins three views; `spoil` changes what the later window says of a pixel of a view: its depth and whether it is still.
    fn joined(spoil: &dyn Fn(usize, usize, &mut f32, &mut bool)) -> Result<Join, JoinError> {
        let mut shared = Shared::default();
        for k in 0..3 {
            let (camera, depth) = view(k);
            let (other, mut other_depth) = elsewhere(&camera, &depth, &TRUTH);
            let mut still = vec![true; PIXELS];
            for p in 0..PIXELS {
                spoil(k, p, &mut other_depth[p], &mut still[p]);
            }
            let sure = vec![2.0; PIXELS];
            let earlier = Seen { depth: &depth, confidence: &sure, still: None, camera };
            let later = Seen { depth: &other_depth, confidence: &sure, still: Some(&still), camera: other };
            shared.add(SIZE, &earlier, &later).unwrap();
        }
        shared.fit()
    }

    #[test]
    fn a_known_similarity_is_found() {
        let join = joined(&|_, _, _, _| {}).unwrap();
        assert!(near(&join.similarity, &TRUTH, 1e-4), "{join:?}");
        assert!(join.residual[1] < 1e-5 && join.turned[1] < 0.1 && join.moved[1] < 1e-5, "{join:?}");
        assert_eq!((join.images, join.points, join.still), (3, 3 * PIXELS, 1.0));
    }

    #[test]
    fn outliers_that_nothing_marks_do_not_count() {
        // A third of the picture, in one block, at another depth.
        let join = joined(&|_, p, z, _| {
            if p % SIZE[1] < SIZE[1] / 3 {
                *z *= 1.7;
            }
        })
        .unwrap();
        assert!(near(&join.similarity, &TRUTH, 1e-3), "{join:?}");
        assert!(join.residual[0] < 1e-3 && join.residual[1] > 0.1, "{join:?}");
    }

    #[test]
    fn what_moves_is_left_out() {
        // Two thirds move: more than any robust fit bears, but they are marked.
        let join = joined(&|k, p, z, still| {
            if p % 3 > 0 {
                (*z, *still) = (*z * (1.3 + 0.2 * k as f32), false);
            }
        })
        .unwrap();
        assert!(near(&join.similarity, &TRUTH, 1e-4), "{join:?}");
        assert!((join.still - 1.0 / 3.0).abs() < 0.02, "{join:?}");
    }

    #[test]
    fn depth_that_has_nothing_to_do_with_it_leaves_a_large_residual() {
        let join = joined(&|k, p, z, _| *z = 0.5 + ((p * 7919 + k * 31) % 97) as f32 / 10.0).unwrap();
        assert!(join.residual[0] > 0.1, "{join:?}");
    }

    #[test]
    fn the_unsure_do_not_count() {
        let (camera, depth) = view(0);
        let (other, mut other_depth) = elsewhere(&camera, &depth, &TRUTH);
        let unsure = |p: usize| p.is_multiple_of(4);
        (0..PIXELS).filter(|p| unsure(*p)).for_each(|p| other_depth[p] *= 3.0);
        let confidence: Vec<f32> = (0..PIXELS).map(|p| if unsure(p) { 1.0 } else { 2.0 }).collect();
        let mut shared = Shared::default();
        let earlier = Seen { depth: &depth, confidence: &confidence, still: None, camera };
        shared.add(SIZE, &earlier, &Seen { depth: &other_depth, camera: other, ..earlier }).unwrap();
        let join = shared.fit().unwrap();
        assert!(near(&join.similarity, &TRUTH, 1e-4) && join.residual[1] < 1e-5, "{join:?}");
    }

    #[test]
    fn a_frozen_camera_is_no_obstacle() {
        let (camera, depth) = view(1);
        let (other, other_depth) = elsewhere(&camera, &depth, &TRUTH);
        let sure = vec![1.0; PIXELS];
        let earlier = Seen { depth: &depth, confidence: &sure, still: None, camera };
        let mut shared = Shared::default();
        for _ in 0..4 {
            shared.add(SIZE, &earlier, &Seen { depth: &other_depth, camera: other, ..earlier }).unwrap();
        }
        assert!(near(&shared.fit().unwrap().similarity, &TRUTH, 1e-4));
    }

    #[test]
    fn what_fixes_nothing_is_said() {
        assert_eq!(Shared::default().fit(), Err(JoinError::NoImages));
        assert_eq!(
            joined(&|_, _, _, still| *still = false),
            Err(JoinError::TooFewPoints { points: 0, pixels: 3 * PIXELS })
        );
        assert!(matches!(joined(&|_, _, z, _| *z = f32::NAN), Err(JoinError::TooFewPoints { .. })));
        // One row of pixels at one depth is a line.
        let row = joined(&|k, p, z, still| (*z, *still) = (2.0, k == 0 && p / SIZE[1] == 5));
        assert!(!matches!(row, Ok(join) if join.residual[0] < 1e-3), "{row:?}");
        let (camera, depth) = view(0);
        let short = Seen { depth: &depth[1..], confidence: &depth, still: None, camera };
        let whole = Seen { depth: &depth, ..short };
        assert!(Shared::default().add(SIZE, &whole, &short).is_err());
    }
}
