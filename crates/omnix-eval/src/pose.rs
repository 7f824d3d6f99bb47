//! Camera trajectories: absolute and relative pose errors, as the tool evo and the benchmarks of MonST3R, CUT3R and pi3 have them.
//!
//! Poses are camera-to-world. After an alignment of positions (estimate onto reference, [`Alignment`]):
//! * absolute, for each pose: `|t_est - t_ref|`, and the angle of `R_ref^T R_est`;
//! * relative, for each pair (i, i + delta): `E = (Q_i^-1 Q_j)^-1 (P_i^-1 P_j)` with reference Q and estimate P; `|t(E)|`, and the
//!   angle of `R(E)`.
//!
//! The numbers of papers are ATE = rmse of the absolute translation, RPE = rmse of the relative ones with delta 1, after a Sim(3).

use serde::Serialize;

use crate::align::{Similarity, umeyama};
use crate::{EvalError, Rigid, Statistics};

/// Seconds within which two times count as the same, in published protocols.
pub const TOLERANCE_S: f64 = 0.01;

/// Poses over time, in the order of the file.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Trajectory {
    /// Seconds, or frame numbers where there are no seconds.
    pub stamps: Vec<f64>,
    /// Camera-to-world.
    pub poses: Vec<Rigid>,
}

impl Trajectory {
    /// The number of poses.
    #[must_use]
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// Whether there is no pose.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.poses.is_empty()
    }

    /// The poses at these places.
    #[must_use]
    pub fn select(&self, places: &[usize]) -> Self {
        Self {
            stamps: places.iter().map(|&k| self.stamps[k]).collect(),
            poses: places.iter().map(|&k| self.poses[k]).collect(),
        }
    }

    /// The positions of the cameras.
    #[must_use]
    pub fn positions(&self) -> Vec<[f64; 3]> {
        self.poses.iter().map(Rigid::translation).collect()
    }

    fn span(&self) -> [f64; 2] {
        let least = self.stamps.iter().copied().fold(f64::INFINITY, f64::min);
        [least, self.stamps.iter().copied().fold(f64::NEG_INFINITY, f64::max)]
    }
}

/// How positions are brought together before errors are taken.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Alignment {
    /// Not at all.
    None,
    /// By rotation and translation.
    Se3,
    /// By rotation, translation and scale.
    Sim3,
    /// By the scale of the Sim(3) alone.
    ScaleOnly,
}

/// All errors of one trajectory.
#[derive(Debug, Clone, PartialEq)]
pub struct PoseErrors {
    /// What brought the estimate onto the reference.
    pub alignment: Similarity,
    /// Distance of each pose, in the reference's unit.
    pub translation: Vec<f64>,
    /// Angle of each pose, degrees.
    pub rotation: Vec<f64>,
}

/// Errors of relative motion, one for each pair.
#[derive(Debug, Clone, PartialEq)]
pub struct RelativeErrors {
    /// Distance, in the reference's unit.
    pub translation: Vec<f64>,
    /// Angle, degrees.
    pub rotation: Vec<f64>,
}

/// The three numbers that benchmarks of videos print.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct VideoPose {
    /// rmse of positions after the Sim(3).
    pub ate: f64,
    /// rmse of relative translation of consecutive poses.
    pub rpe_translation: f64,
    /// rmse of relative rotation of consecutive poses, degrees.
    pub rpe_rotation: f64,
}

/// Poses of the same time. With equal counts the estimate takes over the reference's times first. For each pose of the shorter
/// trajectory the nearest in time of the longer is taken if it is at most `tolerance` away (of two equally near the earlier in the file).
///
/// # Errors
/// [`EvalError::NoOverlap`] if no times agree, [`EvalError::Nothing`] for an empty trajectory.
pub fn associate(
    reference: &Trajectory,
    estimate: &Trajectory,
    tolerance: f64,
) -> Result<(Trajectory, Trajectory), EvalError> {
    if reference.is_empty() || estimate.is_empty() {
        let reason = "a trajectory has no pose; give one line for each frame".to_owned();
        return Err(EvalError::Nothing { reason });
    }
    if reference.len() == estimate.len() {
        let stamped = Trajectory { stamps: reference.stamps.clone(), poses: estimate.poses.clone() };
        return Ok((reference.clone(), stamped));
    }
    let estimate_is_longer = estimate.len() > reference.len();
    let (long, short) = if estimate_is_longer { (estimate, reference) } else { (reference, estimate) };
    let mut order: Vec<usize> = (0..long.len()).collect();
    order.sort_by(|&a, &b| long.stamps[a].total_cmp(&long.stamps[b]).then(a.cmp(&b)));
    let (mut in_short, mut in_long) = (Vec::new(), Vec::new());
    for (place, &stamp) in short.stamps.iter().enumerate() {
        let after = order.partition_point(|&k| long.stamps[k] < stamp);
        // The first of those with the time just before, and the first at or after.
        let before = after.checked_sub(1).map(|last| {
            let time = long.stamps[order[last]];
            order[order.partition_point(|&k| long.stamps[k] < time)]
        });
        let near = |k: usize| (long.stamps[k] - stamp).abs();
        let candidates = before.into_iter().chain(order.get(after).copied());
        let best = candidates.min_by(|&a, &b| near(a).total_cmp(&near(b)).then(a.cmp(&b)));
        if let Some(best) = best.filter(|&k| near(k) <= tolerance) {
            in_short.push(place);
            in_long.push(best);
        }
    }
    if in_short.is_empty() {
        return Err(EvalError::NoOverlap { predicted: estimate.span(), truth: reference.span(), tolerance });
    }
    let (short, long) = (short.select(&in_short), long.select(&in_long));
    Ok(if estimate_is_longer { (short, long) } else { (long, short) })
}

/// Pairs of places in two lists of times, greedily by the smallest difference below `tolerance`, each time used once; in the order
/// of the first list's times. So the TUM benchmark matches pictures with motion capture.
#[must_use]
pub fn associate_greedily(first: &[f64], second: &[f64], tolerance: f64) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..second.len()).collect();
    order.sort_by(|&a, &b| second[a].total_cmp(&second[b]));
    let mut candidates = Vec::new();
    for (i, &a) in first.iter().enumerate() {
        let from = order.partition_point(|&k| second[k] <= a - tolerance);
        candidates.extend(
            order[from..].iter().take_while(|&&k| second[k] - a < tolerance).map(|&k| ((a - second[k]).abs(), i, k)),
        );
    }
    candidates.retain(|(difference, ..)| *difference < tolerance);
    candidates.sort_by(|a, b| {
        a.0.total_cmp(&b.0)
            .then(first[a.1].total_cmp(&first[b.1]))
            .then(second[a.2].total_cmp(&second[b.2]))
            .then((a.1, a.2).cmp(&(b.1, b.2)))
    });
    let (mut used_first, mut used_second) = (vec![false; first.len()], vec![false; second.len()]);
    let mut pairs = Vec::new();
    for (_, i, k) in candidates {
        if !used_first[i] && !used_second[k] {
            (used_first[i], used_second[k]) = (true, true);
            pairs.push((i, k));
        }
    }
    pairs.sort_by(|a, b| first[a.0].total_cmp(&first[b.0]).then(a.cmp(b)));
    pairs
}

/// The estimate brought onto the reference, and by what. For [`Alignment::ScaleOnly`] the whole Sim(3) is returned, of which only the
/// scale was used.
///
/// # Errors
/// [`EvalError::Degenerate`] if the positions determine no alignment, [`EvalError::Counts`] for trajectories of different length.
pub fn align(
    reference: &Trajectory,
    estimate: &Trajectory,
    alignment: Alignment,
) -> Result<(Similarity, Trajectory), EvalError> {
    EvalError::expect("poses", estimate.len(), reference.len())?;
    if alignment == Alignment::None {
        return Ok((Similarity::IDENTITY, estimate.clone()));
    }
    let found = umeyama(&estimate.positions(), &reference.positions(), alignment != Alignment::Se3)?;
    let turn = Similarity { scale: 1.0, ..found };
    let rotation = rigid(&turn)?;
    let moved = estimate.poses.iter().map(|pose| {
        let scaled = pose.with_translation(pose.translation().map(|v| found.scale * v));
        if alignment == Alignment::ScaleOnly { scaled } else { rotation.after(&scaled) }
    });
    Ok((found, Trajectory { stamps: estimate.stamps.clone(), poses: moved.collect() }))
}

fn rigid(similarity: &Similarity) -> Result<Rigid, EvalError> {
    let (r, t) = (similarity.rotation, similarity.translation);
    Rigid::from_rows(&std::array::from_fn(|i| [r[i][0], r[i][1], r[i][2], t[i]]))
        .ok_or(EvalError::Degenerate { reason: "the alignment is not finite" })
}

/// Absolute errors after an alignment, and the aligned estimate.
///
/// # Errors
/// As [`align`].
pub fn absolute(
    reference: &Trajectory,
    estimate: &Trajectory,
    alignment: Alignment,
) -> Result<(PoseErrors, Trajectory), EvalError> {
    let (found, aligned) = align(reference, estimate, alignment)?;
    let pairs = || reference.poses.iter().zip(&aligned.poses);
    let errors = PoseErrors {
        alignment: found,
        translation: pairs().map(|(q, p)| length(&difference(q.translation(), p.translation()))).collect(),
        rotation: pairs().map(|(q, p)| q.inverse().after(p).angle_degrees()).collect(),
    };
    Ok((errors, aligned))
}

/// Errors of the motion from each pose to the `delta`-th after it; empty if there is no such pair.
///
/// # Errors
/// [`EvalError::Counts`] for trajectories of different length, [`EvalError::Parameter`] if `delta` is 0.
pub fn relative(reference: &Trajectory, estimate: &Trajectory, delta: usize) -> Result<RelativeErrors, EvalError> {
    EvalError::expect("poses", estimate.len(), reference.len())?;
    if delta == 0 {
        return Err(EvalError::Parameter { name: "delta", value: "0".into(), expected: "give 1 or more frames" });
    }
    let motion = |poses: &[Rigid], i: usize| poses[i].inverse().after(&poses[i + delta]);
    let pairs = 0..reference.len().saturating_sub(delta);
    let errors: Vec<Rigid> =
        pairs.map(|i| motion(&reference.poses, i).inverse().after(&motion(&estimate.poses, i))).collect();
    Ok(RelativeErrors {
        translation: errors.iter().map(|e| length(&e.translation())).collect(),
        rotation: errors.iter().map(Rigid::angle_degrees).collect(),
    })
}

/// ATE and RPE as benchmarks of videos print them: associated poses, Sim(3), consecutive pairs, rmse.
///
/// # Errors
/// As [`align`]; [`EvalError::Nothing`] for fewer than two poses.
pub fn video_pose(reference: &Trajectory, estimate: &Trajectory) -> Result<VideoPose, EvalError> {
    let (errors, aligned) = absolute(reference, estimate, Alignment::Sim3)?;
    let steps = relative(reference, &aligned, 1)?;
    let rmse = |values: &[f64]| Statistics::of(values).map(|s| s.rmse);
    match (rmse(&errors.translation), rmse(&steps.translation), rmse(&steps.rotation)) {
        (Some(ate), Some(rpe_translation), Some(rpe_rotation)) => Ok(VideoPose { ate, rpe_translation, rpe_rotation }),
        _ => Err(EvalError::Nothing { reason: "a relative error needs two poses".into() }),
    }
}

fn difference(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

fn length(v: &[f64; 3]) -> f64 {
    v.iter().map(|v| v * v).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(n: usize, stamp: impl Fn(usize) -> f64) -> Trajectory {
        let pose = |k: usize| {
            let a = k as f64 * 0.3;
            Rigid::from_quaternion([a.cos(), a.sin(), a * a], [0.0, 0.1 * a, 0.0, 1.0]).unwrap()
        };
        Trajectory { stamps: (0..n).map(stamp).collect(), poses: (0..n).map(pose).collect() }
    }

    #[test]
    fn a_scaled_copy_has_no_error_after_sim3() {
        let truth = curve(8, |k| k as f64);
        let mut scaled = truth.clone();
        for pose in &mut scaled.poses {
            *pose = pose.with_translation(pose.translation().map(|v| v / 3.0));
        }
        let found = video_pose(&truth, &scaled).unwrap();
        assert!(found.ate < 1e-9 && found.rpe_translation < 1e-9 && found.rpe_rotation < 1e-6, "{found:?}");
        let (errors, _) = absolute(&truth, &scaled, Alignment::None).unwrap();
        assert!(Statistics::of(&errors.translation).unwrap().rmse > 0.5);
    }

    #[test]
    fn nearest_times_within_the_tolerance() {
        let truth = curve(10, |k| k as f64 * 0.1);
        // The third is too far off; the order of the file is kept.
        let estimate = curve(3, |k| [0.704, 0.296, 0.45][k]);
        let (reference, found) = associate(&truth, &estimate, TOLERANCE_S).unwrap();
        assert_eq!(reference.stamps, [truth.stamps[7], truth.stamps[3]]);
        assert_eq!(found.stamps, [0.704, 0.296]);
        let late = curve(3, |k| 100.0 + k as f64);
        assert!(matches!(associate(&truth, &late, TOLERANCE_S), Err(EvalError::NoOverlap { .. })));
        assert!(associate(&truth, &Trajectory::default(), TOLERANCE_S).is_err());
    }

    #[test]
    fn equal_counts_take_the_reference_times() {
        let (truth, estimate) = (curve(4, |k| 1e9 + k as f64), curve(4, |k| k as f64));
        assert_eq!(associate(&truth, &estimate, TOLERANCE_S).unwrap().1.stamps, truth.stamps);
    }

    #[test]
    fn each_time_is_matched_once() {
        let pairs = associate_greedily(&[0.0, 0.010, 1.0], &[0.011, 0.004, 2.0], 0.02);
        assert_eq!(pairs, [(0, 1), (1, 0)]);
        assert_eq!(associate_greedily(&[0.0], &[0.02], 0.02), []);
    }

    #[test]
    fn two_poses_or_a_delta_of_none_are_errors() {
        let truth = curve(2, |k| k as f64);
        assert!(matches!(video_pose(&truth, &truth), Err(EvalError::Degenerate { .. })));
        assert!(relative(&truth, &truth, 0).is_err());
        assert!(relative(&truth, &truth, 5).unwrap().translation.is_empty());
    }
}
