//! Trajectories of all pixels: of each source image, where each of its pixels is at each time (`eval.md` section 4).
//!
//! Arrays are `[time][pixel]` in the world, which is the frame of the first camera. Scored are the pixels of a mask (the foreground, or
//! all) at the times at which their truth is finite, seen or hidden. The predicted points are multiplied by the ratio of median norms,
//! APD has the thresholds of TAPVid-3D (`d < k |z| / f`), EPE is the mean distance after the same scale. Source images are averaged
//! plainly, those without a scored pixel left out and counted; videos likewise.

use serde::Serialize;

use super::points::{Thresholds, is_finite, norm, scaled, square_distance};
use super::world::{THRESHOLDS, median_ratio};
use crate::stats::{mean_of_numbers, median};
use crate::{EvalError, Rigid};

/// A source image: points in the world, `[T][P]`.
#[derive(Debug, Clone, Copy)]
pub struct SourceImage<'a> {
    /// True points; not finite where unknown.
    pub truth: &'a [[f64; 3]],
    /// Predicted points.
    pub predicted: &'a [[f64; 3]],
    /// The pixels that are scored, `[P]`.
    pub mask: &'a [bool],
    /// The true world-to-camera pose of the source image.
    pub world_to_camera: Rigid,
    /// The pose with which predicted points go into the source camera; the true one unless the camera is judged too.
    pub predicted_world_to_camera: Rigid,
    /// Mean focal length in pixels at the metric resolution.
    pub focal: f64,
}

/// Where points are compared, and whose depth sets the thresholds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Frame {
    /// The first camera; depth is in the source camera. The default.
    World,
    /// The first camera, and depth in it too.
    WorldWithItsDepth,
    /// The camera of the source image, the same for all times: a wrong camera then costs nothing.
    SourceCamera,
}

/// What predicted points are multiplied by.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum DenseScale {
    /// The ratio of median norms of the scored points of the source image.
    PerImage,
    /// A number, such as that of a whole video ([`VideoScale`]), or 1.
    Given(f64),
}

/// The numbers of a source image, or a mean of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct DenseScore {
    /// Mean of the five shares.
    pub apd: f64,
    /// Mean distance, metres.
    pub epe: f64,
    /// Share within 1, 2, 4, 8, 16 pixels.
    pub within: [f64; 5],
    /// Mean of the shares within St4RTrack's fixed distances (`d <= threshold`), for comparison.
    pub apd_fixed: f64,
    /// What predictions were multiplied by; NaN in a mean.
    pub scale: f64,
    /// Pixels times times that were scored; of a mean their sum.
    pub points: usize,
}

/// Scores a source image; none if no pixel of the mask has a known point.
///
/// # Errors
/// [`EvalError::Counts`] for arrays of different sizes.
pub fn score(image: &SourceImage<'_>, frame: Frame, scale: DenseScale) -> Result<Option<DenseScore>, EvalError> {
    Ok(score_by_time(image, frame, scale)?.map(|(score, _)| score))
}

/// As [`score`], and the mean distance at each time (NaN at a time without a known point).
///
/// # Errors
/// As [`score`].
pub fn score_by_time(
    image: &SourceImage<'_>,
    frame: Frame,
    scale: DenseScale,
) -> Result<Option<(DenseScore, Vec<f64>)>, EvalError> {
    let pixels = image.mask.len();
    let places = scored(image)?;
    if places.is_empty() {
        return Ok(None);
    }
    let into = |points: &[[f64; 3]], pose: &Rigid| -> Vec<[f64; 3]> {
        let moved = |&k: &usize| if frame == Frame::SourceCamera { pose.apply(points[k]) } else { points[k] };
        places.iter().map(moved).collect()
    };
    let truth = into(image.truth, &image.world_to_camera);
    let predicted = into(image.predicted, &image.predicted_world_to_camera);
    let factor = match scale {
        DenseScale::Given(factor) => factor,
        DenseScale::PerImage => median_ratio(&truth, &predicted, &(0..truth.len()).collect::<Vec<_>>()),
    };
    let (mut sums, mut by_time) = (Sums::default(), vec![(0.0, 0usize); image.truth.len() / pixels]);
    for ((&k, &x), &y) in places.iter().zip(&truth).zip(&predicted) {
        let depth = if frame == Frame::World { image.world_to_camera.apply(x)[2] } else { x[2] };
        let distance = sums.add(square_distance(scaled(y, factor), x), depth, image.focal);
        let (sum, count) = &mut by_time[k / pixels];
        *sum += distance;
        *count += 1;
    }
    Ok(Some((sums.score(factor), by_time.iter().map(|(sum, count)| sum / *count as f64).collect())))
}

/// Places of the scored points.
fn scored(image: &SourceImage<'_>) -> Result<Vec<usize>, EvalError> {
    let pixels = image.mask.len();
    EvalError::expect("points of a source image, [T][P]", image.predicted.len(), image.truth.len())?;
    if pixels == 0 || !image.truth.len().is_multiple_of(pixels) {
        return Err(EvalError::counts("points, which are whole images of the mask's size", image.truth.len(), pixels));
    }
    Ok((0..image.truth.len()).filter(|k| image.mask[k % pixels] && is_finite(image.truth[*k])).collect())
}

/// The mean over source images or videos; none of an empty list. A mean over images that have a NaN leaves that number out.
#[must_use]
pub fn mean(scores: &[DenseScore]) -> Option<DenseScore> {
    if scores.is_empty() {
        return None;
    }
    let of = |value: &dyn Fn(&DenseScore) -> f64| mean_of_numbers(scores.iter().map(value)).0;
    Some(DenseScore {
        apd: of(&|s| s.apd),
        epe: of(&|s| s.epe),
        within: std::array::from_fn(|k| of(&|s| s.within[k])),
        apd_fixed: of(&|s| s.apd_fixed),
        scale: f64::NAN,
        points: scores.iter().map(|s| s.points).sum(),
    })
}

/// The mean weighted by scored points: of the source images of a scene under one scale, as if their points were one list.
#[must_use]
pub fn pooled(scores: &[DenseScore]) -> Option<DenseScore> {
    let points: usize = scores.iter().map(|s| s.points).sum();
    let of = |value: &dyn Fn(&DenseScore) -> f64| {
        scores.iter().map(|s| value(s) * s.points as f64).sum::<f64>() / points as f64
    };
    (points > 0).then(|| DenseScore {
        apd: of(&|s| s.apd),
        epe: of(&|s| s.epe),
        within: std::array::from_fn(|k| of(&|s| s.within[k])),
        apd_fixed: of(&|s| s.apd_fixed),
        scale: scores[0].scale,
        points,
    })
}

/// One scale for all source images of a video: the ratio of the median norms of all their scored points. Holds two numbers a point.
#[derive(Debug, Clone, Default)]
pub struct VideoScale {
    truth: Vec<f64>,
    predicted: Vec<f64>,
}

impl VideoScale {
    /// Adds the scored points of a source image, in the world.
    ///
    /// # Errors
    /// As [`score`].
    pub fn add(&mut self, image: &SourceImage<'_>) -> Result<(), EvalError> {
        for k in scored(image)? {
            self.truth.push(norm(image.truth[k]));
            self.predicted.extend(Some(norm(image.predicted[k])).filter(|v| !v.is_nan()));
        }
        Ok(())
    }

    /// The scale; none if nothing was scored.
    #[must_use]
    pub fn scale(mut self) -> Option<f64> {
        Some(median(&mut self.truth)? / median(&mut self.predicted)?)
    }
}

#[derive(Default)]
struct Sums {
    distance: f64,
    within: [usize; 5],
    fixed: [usize; 4],
    points: usize,
}

impl Sums {
    /// Adds a point by its squared distance; the distance, infinite where nothing was predicted.
    fn add(&mut self, square: f64, depth: f64, focal: f64) -> f64 {
        let distance = if square.is_nan() { f64::INFINITY } else { square.sqrt() };
        self.distance += distance;
        for (k, count) in self.within.iter_mut().enumerate() {
            *count += usize::from(square < Thresholds::DepthAdaptive.squared(k, depth, focal));
        }
        for (count, threshold) in self.fixed.iter_mut().zip(THRESHOLDS) {
            *count += usize::from(distance <= threshold);
        }
        self.points += 1;
        distance
    }

    fn score(&self, scale: f64) -> DenseScore {
        let n = self.points as f64;
        let within = self.within.map(|count| count as f64 / n);
        DenseScore {
            apd: within.iter().sum::<f64>() / 5.0,
            epe: self.distance / n,
            within,
            apd_fixed: self.fixed.iter().map(|&count| count as f64 / n).sum::<f64>() / 4.0,
            scale,
            points: self.points,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: [[f64; 3]; 4] = [[0.0, 0.0, 2.0], [1.0, 0.0, 4.0], [0.5, 0.0, 2.0], [1.0, 0.0, 4.0]];

    fn image<'a>(truth: &'a [[f64; 3]], predicted: &'a [[f64; 3]], mask: &'a [bool]) -> SourceImage<'a> {
        let pose = Rigid::IDENTITY;
        SourceImage { truth, predicted, mask, world_to_camera: pose, predicted_world_to_camera: pose, focal: 100.0 }
    }

    #[test]
    fn a_scaled_copy_is_perfect() {
        let third = TRUTH.map(|p| scaled(p, 1.0 / 3.0));
        let found = score(&image(&TRUTH, &third, &[true; 2]), Frame::World, DenseScale::PerImage).unwrap().unwrap();
        assert!((found.scale - 3.0).abs() < 1e-12 && found.epe < 1e-12 && found.apd == 1.0, "{found:?}");
        let mut video = VideoScale::default();
        video.add(&image(&TRUTH, &third, &[true; 2])).unwrap();
        assert!((video.scale().unwrap() - 3.0).abs() < 1e-12);
    }

    #[test]
    fn only_the_mask_and_known_points_are_scored() {
        let mut truth = TRUTH;
        truth[2] = [f64::NAN; 3];
        let mut predicted = TRUTH;
        predicted[1][0] += 100.0;
        let scale = DenseScale::Given(1.0);
        let (found, by_time) =
            score_by_time(&image(&truth, &predicted, &[true, false]), Frame::World, scale).unwrap().unwrap();
        assert_eq!((found.points, found.epe, found.apd), (1, 0.0, 1.0));
        assert!(by_time[0] == 0.0 && by_time[1].is_nan());
        assert_eq!(score(&image(&truth, &predicted, &[false; 2]), Frame::World, scale).unwrap(), None);
        assert!(score(&image(&truth, &predicted[..2], &[true; 2]), Frame::World, scale).is_err());
        assert!(score(&image(&truth, &predicted, &[]), Frame::World, scale).is_err());
    }

    #[test]
    fn a_wrong_camera_costs_nothing_in_the_source_camera() {
        let shift = Rigid::IDENTITY.with_translation([0.0, 0.0, 5.0]);
        let moved = TRUTH.map(|p| shift.inverse().apply(p));
        let mut image = image(&TRUTH, &moved, &[true; 2]);
        image.predicted_world_to_camera = shift;
        let of = |frame| score(&image, frame, DenseScale::Given(1.0)).unwrap().unwrap().epe;
        assert_eq!((of(Frame::SourceCamera), of(Frame::World)), (0.0, 5.0));
    }

    #[test]
    fn means_leave_nothing_out_silently() {
        let one = DenseScore { apd: 0.5, epe: 1.0, within: [0.5; 5], apd_fixed: 0.5, scale: 1.0, points: 1 };
        let two = DenseScore { apd: 1.0, epe: 0.0, points: 3, ..one };
        assert_eq!(mean(&[one, two]).unwrap().apd, 0.75);
        assert_eq!((pooled(&[one, two]).unwrap().epe, pooled(&[one, two]).unwrap().points), (0.25, 4));
        assert_eq!((mean(&[]), pooled(&[])), (None, None));
    }
}
