//! Motion against its truth: displacements of what moves, which pixels move, and what moves in a scene that stands still.

use glam::DVec3;
use omnix_data::{Flag, Sample};

use super::pairs::Frame;

/// A pixel moves where its score is above this.
const MOVES: f32 = 0.5;
/// A point of a still scene that goes further than this, in units of the mean distance, moves.
const FAR: f64 = 0.01;

/// Sums of |s D̂ − D| and of |D| over pixels labelled as moving, with valid depth, and times other than their own at which their place is
/// known. Without a prediction nothing moves.
pub(super) fn displacement(sample: &Sample, labels: &[Flag], predicted: Option<(&[[f32; 3]], &Frame)>) -> [f64; 2] {
    let (count, pixels) = (sample.count(), sample.pixels());
    let (mut error, mut length) = (0.0, 0.0);
    for source in 0..count {
        let Some(own) = sample.positions(source, source) else { continue };
        for time in (0..count).filter(|time| *time != source) {
            let Some(then) = sample.positions(source, time) else { continue };
            for pixel in
                (0..pixels).filter(|pixel| labels[source * pixels + pixel] == Flag::Yes && sample.valid(source, *pixel))
            {
                if !own[pixel][0].is_finite() || !then[pixel][0].is_finite() {
                    continue;
                }
                let wanted = DVec3::from(then[pixel].map(f64::from)) - DVec3::from(own[pixel].map(f64::from));
                let found = predicted.map_or(DVec3::ZERO, |(positions, frame)| {
                    let at = |time: usize| positions[(source * count + time) * pixels + pixel];
                    frame.displacement(at(source), at(time))
                });
                error += (found - wanted).length();
                length += wanted.length();
            }
        }
    }
    [error, length]
}

/// Pixels that move and were found, and those that move or were found, of those whose label is known. Without scores none is found.
pub(super) fn overlap(labels: &[Flag], theta: Option<&[f32]>) -> [u64; 2] {
    let (mut both, mut either) = (0, 0);
    for (i, label) in labels.iter().enumerate().filter(|(_, label)| **label != Flag::Unknown) {
        let (moves, found) = (*label == Flag::Yes, theta.is_some_and(|theta| theta[i] > MOVES));
        both += u64::from(moves && found);
        either += u64::from(moves || found);
    }
    [both, either]
}

/// Share of pixels with a known label that go too far at any time, of a sample in which nothing moves; NaN of any other.
pub(super) fn still(sample: &Sample, labels: &[Flag], positions: &[[f32; 3]], frame: &Frame) -> f64 {
    let (count, pixels) = (sample.count(), sample.pixels());
    if labels.contains(&Flag::Yes) {
        return f64::NAN;
    }
    let (mut moved, mut known) = (0u64, 0u64);
    for (i, _) in labels.iter().enumerate().filter(|(_, label)| **label == Flag::No) {
        let (source, pixel) = (i / pixels, i % pixels);
        let at = |time: usize| positions[(source * count + time) * pixels + pixel];
        known += 1;
        moved += u64::from((0..count).any(|time| frame.displacement(at(source), at(time)).length() > FAR));
    }
    moved as f64 / known as f64
}
