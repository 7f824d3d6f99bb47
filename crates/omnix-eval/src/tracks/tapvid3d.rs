//! The metrics of TAPVid-3D for one clip (`eval.md` section 3), with its seven ways to scale a prediction.
//!
//! With v = visible in truth, p = predicted visible, X = truth, Y = prediction in the camera of each time, s = scale, and the
//! k-th threshold d_k: `within_k = |sY - X|^2 < d_k^2`;
//! pts_within_k = sum(within & v)/sum(v); jaccard_k = sum(within & v & p)/(sum(v) + sum(p & (!v | !within))); APD and AJ are the means
//! over the five k; occlusion accuracy = mean(p == v). Norms are at least 1e-6. Where nothing is visible 0/0 gives NaN.

use serde::Serialize;

use super::points::{Thresholds, mean_focal, norm, scaled, square_distance};
use crate::EvalError;
use crate::stats::median;

/// What a norm and a depth are at least.
const LEAST_NORM: f64 = 1e-6;
const LEAST_DEPTH: f64 = 1e-12;
/// Metres within which tracks are neighbours, in published runs.
pub const NEIGHBOURHOOD: f64 = 0.05;

/// A clip: `[T][N]` points in the camera of each time.
#[derive(Debug, Clone, Copy)]
pub struct Clip<'a> {
    /// T.
    pub frames: usize,
    /// True points.
    pub truth: &'a [[f64; 3]],
    /// Whether each is visible.
    pub visible: &'a [bool],
    /// Predicted points.
    pub predicted: &'a [[f64; 3]],
    /// Whether each is predicted visible.
    pub predicted_visible: &'a [bool],
    /// The frame in which each of the N tracks was asked for.
    pub query_frames: &'a [usize],
    /// fx, fy in pixels at the metric resolution.
    pub focal: [f64; 2],
}

/// How a prediction is scaled onto the truth.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Scaling {
    /// Ratio of the median norms over what is visible in both. The benchmark's default.
    Median,
    /// Ratio of the mean norms over the same.
    Mean,
    /// 1.
    None,
    /// For each track the ratio of depths in its query frame.
    PerTrajectory,
    /// For each point the ratio of depths: what 2D tracking would see.
    Reproduce2d,
    /// Ratio of the median norms over the query frames.
    MedianOnQueries,
    /// As per trajectory, scored over all points within this many metres of the track. For [`score_tracks`] alone.
    LocalNeighbourhood(f64),
}

/// The metrics of a clip or of a track.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct TrackMetrics {
    /// Share of points whose visibility is right.
    pub occlusion_accuracy: f64,
    /// Share of visible points within each threshold.
    pub pts_within: [f64; 5],
    /// Jaccard of each threshold.
    pub jaccard: [f64; 5],
    /// AJ.
    pub average_jaccard: f64,
    /// APD.
    pub average_pts_within: f64,
}

impl TrackMetrics {
    /// What a missing or unreadable prediction gets.
    pub const ZERO: Self = Self {
        occlusion_accuracy: 0.0,
        pts_within: [0.0; 5],
        jaccard: [0.0; 5],
        average_jaccard: 0.0,
        average_pts_within: 0.0,
    };
}

impl Scaling {
    /// Those that give one result for a clip.
    pub const OF_CLIPS: [Self; 6] =
        [Self::Median, Self::Mean, Self::None, Self::PerTrajectory, Self::Reproduce2d, Self::MedianOnQueries];

    /// The benchmark's name.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Median => "median",
            Self::Mean => "mean",
            Self::None => "none",
            Self::PerTrajectory => "per_trajectory",
            Self::Reproduce2d => "reproduce_2d",
            Self::MedianOnQueries => "median_on_queries",
            Self::LocalNeighbourhood(_) => "local_neighborhood",
        }
    }
}

/// The metrics of a clip.
///
/// # Errors
/// [`EvalError::Counts`] for arrays of different sizes, [`EvalError::Parameter`] for a query frame outside the clip, a focal length that is
/// not positive, or [`Scaling::LocalNeighbourhood`].
pub fn score(clip: &Clip<'_>, scaling: Scaling, thresholds: Thresholds) -> Result<TrackMetrics, EvalError> {
    if let Scaling::LocalNeighbourhood(radius) = scaling {
        let expected = "a neighbourhood belongs to a track: use it for results of each track";
        return Err(EvalError::Parameter { name: "scaling by neighbourhood", value: radius.to_string(), expected });
    }
    let (scales, focal) = prepare(clip, scaling)?;
    let mut sums = Sums::default();
    for place in 0..clip.truth.len() {
        sums.add(clip, place, scales.at(place), 1.0, thresholds, focal);
    }
    Ok(sums.metrics())
}

/// The metrics of each track of a clip.
///
/// # Errors
/// As [`score`], without the last.
pub fn score_tracks(clip: &Clip<'_>, scaling: Scaling, thresholds: Thresholds) -> Result<Vec<TrackMetrics>, EvalError> {
    let (scales, focal) = prepare(clip, scaling)?;
    let tracks = clip.query_frames.len();
    let of_track = |track: usize| (0..clip.frames).map(move |t| t * tracks + track);
    let one = |track: usize| {
        let mut sums = Sums::default();
        if let Scaling::LocalNeighbourhood(radius) = scaling {
            let near = neighbours(clip, track, radius);
            // All neighbours together weigh as much as the track's own visible points.
            let own = of_track(track).filter(|&k| clip.visible[k]).count();
            let seen = near.iter().filter(|&&k| clip.visible[k]).count();
            let weight = own as f64 / seen.max(1) as f64;
            for place in near {
                sums.add(clip, place, scales.at(track), weight, thresholds, focal);
            }
        } else {
            for place in of_track(track) {
                sums.add(clip, place, scales.at(place), 1.0, thresholds, focal);
            }
        }
        sums.metrics()
    };
    Ok((0..tracks).map(one).collect())
}

/// The distance of each point after the scaling, `[T][N]`: NaN where the truth is not visible, infinite where the prediction is no number.
/// EPE is the mean over those that are visible.
///
/// # Errors
/// As [`score`], without the last.
pub fn distances(clip: &Clip<'_>, scaling: Scaling) -> Result<Vec<f64>, EvalError> {
    let (scales, _) = prepare(clip, scaling)?;
    let of = |place: usize| {
        let distance = square_distance(scaled(clip.predicted[place], scales.at(place)), clip.truth[place]).sqrt();
        match (clip.visible[place], distance.is_nan()) {
            (false, _) => f64::NAN,
            (true, true) => f64::INFINITY,
            (true, false) => distance,
        }
    };
    Ok((0..clip.truth.len()).map(of).collect())
}

/// Points, of any track, that are within `radius` of the track's point of the same time.
fn neighbours(clip: &Clip<'_>, track: usize, radius: f64) -> Vec<usize> {
    let tracks = clip.query_frames.len();
    let near = |&place: &usize| {
        square_distance(clip.truth[place], clip.truth[place / tracks * tracks + track]) < radius * radius
    };
    (0..clip.truth.len()).filter(near).collect()
}

/// What each point is multiplied by.
enum Scales {
    All(f64),
    /// By the place of the point modulo the number of tracks.
    Tracks(Vec<f64>),
    Points(Vec<f64>),
}

impl Scales {
    fn at(&self, place: usize) -> f64 {
        match self {
            Self::All(scale) => *scale,
            Self::Tracks(scales) => scales[place % scales.len()],
            Self::Points(scales) => scales[place],
        }
    }
}

/// Checks a clip; its scales and mean focal length.
fn prepare(clip: &Clip<'_>, scaling: Scaling) -> Result<(Scales, f64), EvalError> {
    let (frames, tracks) = (clip.frames, clip.query_frames.len());
    let points = frames.saturating_mul(tracks);
    EvalError::expect("points of the truth, [T][N]", clip.truth.len(), points)?;
    EvalError::expect("visibilities of the truth, [T][N]", clip.visible.len(), points)?;
    EvalError::expect("points, [T][N]", clip.predicted.len(), points)?;
    EvalError::expect("visibilities, [T][N]", clip.predicted_visible.len(), points)?;
    if let Some(frame) = clip.query_frames.iter().find(|&&frame| frame >= frames) {
        let expected = "a track is asked for in a frame of its clip";
        return Err(EvalError::Parameter { name: "query frame", value: frame.to_string(), expected });
    }
    let focal = mean_focal(clip.focal)?;
    let at_query = |track: usize| clip.query_frames[track] * tracks + track;
    let in_both = |place: &usize| clip.visible[*place] && clip.predicted_visible[*place];
    let ratio = |of: fn(Vec<f64>) -> f64, places: Vec<usize>| {
        // Unknown positions belong to no median or mean, as in numpy's nanmedian.
        let numbers = |points: &[[f64; 3]]| {
            let norms = places.iter().map(|&k| norm(points[k])).filter(|v| !v.is_nan());
            of(norms.map(|v| v.max(LEAST_NORM)).collect())
        };
        Scales::All(numbers(clip.truth) / numbers(clip.predicted))
    };
    let median_of = |mut values: Vec<f64>| median(&mut values).unwrap_or(f64::NAN);
    let mean_of = |values: Vec<f64>| values.iter().sum::<f64>() / values.len() as f64;
    let scales = match scaling {
        Scaling::None => Scales::All(1.0),
        Scaling::Median => ratio(median_of, (0..points).filter(in_both).collect()),
        Scaling::Mean => ratio(mean_of, (0..points).filter(in_both).collect()),
        Scaling::MedianOnQueries => ratio(median_of, (0..tracks).map(at_query).filter(in_both).collect()),
        Scaling::Reproduce2d => {
            Scales::Points(clip.truth.iter().zip(clip.predicted).map(|(x, y)| x[2] / y[2]).collect())
        }
        Scaling::PerTrajectory | Scaling::LocalNeighbourhood(_) => {
            let depth = |points: &[[f64; 3]], place: usize| points[place][2].max(LEAST_DEPTH);
            let of = |track| depth(clip.truth, at_query(track)) / depth(clip.predicted, at_query(track));
            Scales::Tracks((0..tracks).map(of).collect())
        }
    };
    Ok((scales, focal))
}

#[derive(Default)]
struct Sums {
    points: f64,
    agreeing: f64,
    visible: f64,
    within: [f64; 5],
    hits: [f64; 5],
    false_positives: [f64; 5],
}

impl Sums {
    fn add(&mut self, clip: &Clip<'_>, place: usize, scale: f64, weight: f64, thresholds: Thresholds, focal: f64) {
        let (v, p) = (clip.visible[place], clip.predicted_visible[place]);
        let x = clip.truth[place];
        let distance = square_distance(scaled(clip.predicted[place], scale), x);
        let of = |yes: bool| if yes { weight } else { 0.0 };
        self.points += weight;
        self.agreeing += of(v == p);
        self.visible += of(v);
        for k in 0..5 {
            let within = distance < thresholds.squared(k, x[2], focal);
            self.within[k] += of(within && v);
            self.hits[k] += of(within && v && p);
            self.false_positives[k] += of(p && !(v && within));
        }
    }

    fn metrics(&self) -> TrackMetrics {
        let pts_within: [f64; 5] = std::array::from_fn(|k| self.within[k] / self.visible);
        let jaccard: [f64; 5] = std::array::from_fn(|k| self.hits[k] / (self.visible + self.false_positives[k]));
        let mean = |values: &[f64; 5]| values.iter().sum::<f64>() / 5.0;
        TrackMetrics {
            occlusion_accuracy: self.agreeing / self.points,
            pts_within,
            jaccard,
            average_jaccard: mean(&jaccard),
            average_pts_within: mean(&pts_within),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRUTH: [[f64; 3]; 4] = [[0.0, 0.0, 2.0], [1.0, 0.0, 3.0], [0.0, 0.1, 2.0], [1.0, 0.1, 3.0]];

    fn clip<'a>(predicted: &'a [[f64; 3]], visible: &'a [bool], predicted_visible: &'a [bool]) -> Clip<'a> {
        let (truth, query_frames) = (&TRUTH, &[0, 1]);
        Clip { frames: 2, truth, visible, predicted, predicted_visible, query_frames, focal: [200.0, 200.0] }
    }

    #[test]
    fn a_scaled_copy_is_perfect_under_all_scalings_but_none() {
        let half = TRUTH.map(|p| scaled(p, 0.5));
        let clip = clip(&half, &[true; 4], &[true; 4]);
        for scaling in Scaling::OF_CLIPS {
            let found = score(&clip, scaling, Thresholds::DepthAdaptive).unwrap();
            let want = if scaling == Scaling::None { 0.0 } else { 1.0 };
            assert_eq!((found.average_pts_within, found.average_jaccard), (want, want), "{scaling:?}");
        }
        let tracks = score_tracks(&clip, Scaling::LocalNeighbourhood(NEIGHBOURHOOD), Thresholds::DepthAdaptive);
        assert!(tracks.unwrap().iter().all(|t| t.average_jaccard == 1.0));
    }

    #[test]
    fn the_threshold_is_strict() {
        // One pixel at 2 m is exactly 0.01 m: 2/200.
        let mut near = TRUTH;
        near[0][0] = 0.01;
        let clip = clip(&near, &[true, false, false, false], &[true; 4]);
        let found = score(&clip, Scaling::None, Thresholds::Fixed([0.01, 0.02, 0.04, 0.08, 0.16])).unwrap();
        assert_eq!(found.pts_within, [0.0, 1.0, 1.0, 1.0, 1.0]);
        // Three points that are not visible are predicted so.
        assert_eq!(found.jaccard[1], 0.25);
        assert_eq!(found.occlusion_accuracy, 0.25);
    }

    #[test]
    fn wrong_sizes_and_frames_are_errors() {
        let mut bad = clip(&TRUTH, &[true; 4], &[true; 4]);
        bad.frames = 3;
        assert!(matches!(score(&bad, Scaling::Median, Thresholds::DepthAdaptive), Err(EvalError::Counts { .. })));
        let mut bad = clip(&TRUTH, &[true; 4], &[true; 4]);
        bad.query_frames = &[0, 2];
        assert!(matches!(score(&bad, Scaling::Median, Thresholds::DepthAdaptive), Err(EvalError::Parameter { .. })));
        bad.query_frames = &[0, 1];
        bad.focal = [0.0, 100.0];
        assert!(score(&bad, Scaling::Median, Thresholds::DepthAdaptive).is_err());
        let bad = clip(&TRUTH, &[true; 4], &[true; 4]);
        assert!(score(&bad, Scaling::LocalNeighbourhood(0.05), Thresholds::DepthAdaptive).is_err());
    }
}
