//! Sparse tracks in the frame of the first camera, as St4RTrack scores them: APD with fixed thresholds, EPE, three ways to align.
//!
//! `[T][N]` points, all of them scored at all times, visible or not. APD = mean over thresholds of the share with `d <= threshold`.
//! Points whose truth is NaN or infinite are unknown and left out; a prediction that is not finite is within nothing, and EPE is infinite.

use serde::Serialize;

use super::points::{is_finite, norm, scaled, square_distance};
use crate::align::{Similarity, umeyama};
use crate::stats::median;
use crate::{EvalError, Rigid};

/// St4RTrack's thresholds, metres.
pub const THRESHOLDS: [f64; 4] = [0.1, 0.3, 0.5, 1.0];
/// Metres of path from which on St4RTrack counts a track as moving.
pub const MOVING: f64 = 0.01;
const LEAST_NORM: f64 = 1e-12;

/// How predicted points are brought onto the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum WorldAlignment {
    /// By the ratio of the median norms of all points at all times.
    Global,
    /// By that ratio for each track.
    PerTrack,
    /// By the least-squares similarity over all points.
    Similarity,
    /// By a scale found elsewhere.
    Given(f64),
}

/// The numbers of a set of tracks.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct WorldScore {
    /// Mean of the shares.
    pub apd: f64,
    /// Mean distance, metres.
    pub epe: f64,
    /// Share within each of [`THRESHOLDS`].
    pub within: [f64; 4],
    /// What was applied; the identity where each track has a scale of its own.
    pub alignment: Similarity,
    /// Points times frames that were scored.
    pub points: usize,
}

/// Scores `tracks` tracks.
///
/// # Errors
/// [`EvalError::Counts`] for arrays of different sizes, [`EvalError::Nothing`] without a known point, [`EvalError::Degenerate`] where no
/// similarity is determined.
pub fn score(
    truth: &[[f64; 3]],
    predicted: &[[f64; 3]],
    tracks: usize,
    alignment: WorldAlignment,
) -> Result<WorldScore, EvalError> {
    EvalError::expect("points, [T][N]", predicted.len(), truth.len())?;
    if tracks == 0 || !truth.len().is_multiple_of(tracks) {
        return Err(EvalError::counts("points, which are whole frames of tracks", truth.len(), tracks));
    }
    let known: Vec<usize> = (0..truth.len()).filter(|&k| is_finite(truth[k])).collect();
    if known.is_empty() {
        let reason = "no point of the truth is known at any time; choose another sequence".to_owned();
        return Err(EvalError::Nothing { reason });
    }
    let mut found = Similarity::IDENTITY;
    let mut per_track = Vec::new();
    match alignment {
        WorldAlignment::Global => found = Similarity::of_scale(median_ratio(truth, predicted, &known)),
        WorldAlignment::Given(scale) => found = Similarity::of_scale(scale),
        WorldAlignment::PerTrack => {
            let of = |track: usize| {
                let places: Vec<usize> = known.iter().copied().filter(|k| k % tracks == track).collect();
                median_ratio(truth, predicted, &places)
            };
            per_track = (0..tracks).map(of).collect();
        }
        WorldAlignment::Similarity => {
            let pick = |points: &[[f64; 3]]| -> Vec<[f64; 3]> { known.iter().map(|&k| points[k]).collect() };
            found = umeyama(&pick(predicted), &pick(truth), true)?;
        }
    }
    let (mut sum, mut counts) = (0.0, [0usize; 4]);
    for &k in &known {
        let moved =
            if per_track.is_empty() { found.apply(predicted[k]) } else { scaled(predicted[k], per_track[k % tracks]) };
        let distance = square_distance(moved, truth[k]).sqrt();
        sum += if distance.is_nan() { f64::INFINITY } else { distance };
        for (count, threshold) in counts.iter_mut().zip(THRESHOLDS) {
            *count += usize::from(distance <= threshold);
        }
    }
    let points = known.len();
    let within = counts.map(|count| count as f64 / points as f64);
    let apd = within.iter().sum::<f64>() / 4.0;
    Ok(WorldScore { apd, epe: sum / points as f64, within, alignment: found, points })
}

/// The ratio of the median norms of some points.
pub(super) fn median_ratio(truth: &[[f64; 3]], predicted: &[[f64; 3]], places: &[usize]) -> f64 {
    let of = |points: &[[f64; 3]]| {
        let mut norms: Vec<f64> =
            places.iter().map(|&k| norm(points[k])).filter(|v| !v.is_nan()).map(|v| v.max(LEAST_NORM)).collect();
        median(&mut norms).unwrap_or(f64::NAN)
    };
    of(truth) / of(predicted).max(LEAST_NORM)
}

/// Whether each track moves: the sum of its steps is above [`MOVING`].
#[must_use]
pub fn moving(truth: &[[f64; 3]], tracks: usize) -> Vec<bool> {
    let path = |track: usize| -> f64 {
        let points: Vec<[f64; 3]> = truth.iter().skip(track).step_by(tracks.max(1)).copied().collect();
        points.windows(2).map(|step| square_distance(step[0], step[1]).sqrt()).filter(|v| !v.is_nan()).sum()
    };
    (0..tracks).map(|track| path(track) > MOVING).collect()
}

/// World-to-camera poses made relative to the first: the first becomes the identity.
#[must_use]
pub fn relative_to_first(world_to_camera: &[Rigid]) -> Vec<Rigid> {
    let Some(first) = world_to_camera.first().map(Rigid::inverse) else {
        return Vec::new();
    };
    world_to_camera.iter().map(|pose| pose.after(&first)).collect()
}

/// Points in the camera of each time, `[T][N]`, moved into the frame of the first camera. `poses` are world-to-camera, one for each time.
///
/// # Errors
/// [`EvalError::Counts`] unless there is a pose for each frame.
pub fn to_first_camera(points: &[[f64; 3]], tracks: usize, poses: &[Rigid]) -> Result<Vec<[f64; 3]>, EvalError> {
    EvalError::expect("frames of tracks with a pose each", points.len(), poses.len().saturating_mul(tracks))?;
    let back: Vec<Rigid> = relative_to_first(poses).iter().map(Rigid::inverse).collect();
    Ok(points.iter().enumerate().map(|(k, &point)| back[k / tracks].apply(point)).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn distances_at_the_threshold_count_and_unknown_points_do_not() {
        let truth = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 1.0], [f64::NAN; 3]];
        let predicted = [[0.1, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 2.0, 1.0], [0.0; 3]];
        let found = score(&truth, &predicted, 2, WorldAlignment::Given(1.0)).unwrap();
        assert_eq!(found.points, 3);
        assert_eq!(found.within, [2.0 / 3.0; 4]);
        assert!((found.epe - 0.7).abs() < 1e-12);
    }

    #[test]
    fn a_missing_prediction_is_not_overlooked() {
        let truth = [[0.0, 0.0, 1.0], [0.0, 0.0, 2.0]];
        let found = score(&truth, &[truth[0], [f64::NAN; 3]], 2, WorldAlignment::Given(1.0)).unwrap();
        assert_eq!((found.apd, found.epe), (0.5, f64::INFINITY));
    }

    #[test]
    fn nothing_known_and_wrong_sizes_are_errors() {
        let unknown = [[f64::NAN; 3]; 2];
        assert!(matches!(score(&unknown, &unknown, 2, WorldAlignment::Global), Err(EvalError::Nothing { .. })));
        assert!(score(&unknown, &unknown[..1], 2, WorldAlignment::Global).is_err());
        assert!(score(&unknown, &unknown, 0, WorldAlignment::Global).is_err());
        assert!(to_first_camera(&unknown, 1, &[Rigid::IDENTITY]).is_err());
    }

    #[test]
    fn what_moves_is_found_by_its_path() {
        let truth = [[0.0; 3], [0.0; 3], [0.02, 0.0, 0.0], [0.0; 3]];
        assert_eq!(moving(&truth, 2), [true, false]);
    }
}
