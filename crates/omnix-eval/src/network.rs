//! What a network says of samples whose depth, cameras and motion are known, figure by figure, beside trivial answers to the same
//! samples. Geometry cannot hide motion here: each figure is measured apart.
//!
//! | figure | of a sample |
//! |---|---|
//! | AbsRel | mean of \|s p − g\| / g over pixels with known depth of all images, with the one scale s that makes it least |
//! | delta | share of those pixels with max(s p / g, g / (s p)) < 1.25 |
//! | displacement | Σ \|s D̂ − D\| / Σ \|D\| over moving pixels and other times, D = P(t) − P(own): standing still has 1 |
//! | IoU | moving pixels that were found, over those found or moving |
//! | still | share of pixels of a sample without motion that go further than a hundredth of the mean distance |
//! | rotation | mean angle between predicted and true relative rotations, over pairs of images, degrees |
//! | direction | the same of the directions of relative translations, where these are longer than 2 % of the mean distance, degrees |
//!
//! Samples are normalised first (`spec/omnix.md` 11.1). Positions are compared in the frame of the first camera, of the prediction and
//! of the truth. A figure of several samples is the mean over the samples that have it, but displacement and IoU, whose sums go over
//! all samples: a sample in which a few pixels move must not weigh as much as one in which half of them do.

mod depth;
mod motion;
mod pairs;
mod report;

use omnix_data::{Sample, normalise, targets};
use omnix_geometry::Camera;

pub use self::report::Figures;
use crate::EvalError;

/// What a network says of a sample of T images of H x W pixels.
#[derive(Debug, Clone, Copy)]
pub struct Answer<'a> {
    /// `[T][H][W]`, above 0, in any unit.
    pub depth: &'a [f32],
    /// `[T]`, world-to-camera, in the unit of depth.
    pub cameras: &'a [Camera],
    /// Where its points go; none of a network without trajectories.
    pub motion: Option<Motion<'a>>,
}

/// Where a network's points go.
#[derive(Debug, Clone, Copy)]
pub struct Motion<'a> {
    /// `[T source][T time][H][W]` positions in the world of the cameras.
    pub positions: &'a [[f32; 3]],
    /// `[T][H][W]`: motion score; a pixel moves where it is above 0.5.
    pub theta: &'a [f32],
}

/// The figures of one answer to one sample; NaN where the sample or the answer has none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Score {
    /// Mean relative error of depth.
    pub abs_rel: f64,
    /// Share of pixels within a factor of 1.25.
    pub delta: f64,
    /// Sum of the errors of displacements, and of the displacements, in units of the mean distance.
    pub displacement: [f64; 2],
    /// Pixels found and moving, found or moving.
    pub overlap: [u64; 2],
    /// Of a sample without motion: share of pixels that move all the same.
    pub still: f64,
    /// Degrees.
    pub rotation: f64,
    /// Degrees.
    pub direction: f64,
}

impl Score {
    /// Nothing is known.
    const NONE: Self = Self {
        abs_rel: f64::NAN,
        delta: f64::NAN,
        displacement: [0.0; 2],
        overlap: [0; 2],
        still: f64::NAN,
        rotation: f64::NAN,
        direction: f64::NAN,
    };
}

/// The figures of an answer, and those of the trivial ones to the same sample: [`Trivial`], in its order.
///
/// # Errors
/// [`EvalError::Counts`] for an answer of another size; a sample that cannot be normalised ([`EvalError::Sample`]).
pub fn score(sample: &Sample, answer: &Answer<'_>) -> Result<(Score, [Score; 3]), EvalError> {
    let sample = normalise(sample.clone())?.sample;
    let (count, pixels) = (sample.count(), sample.pixels());
    EvalError::expect("depths of an answer, [T][H][W]", answer.depth.len(), count * pixels)?;
    EvalError::expect("cameras of an answer, [T]", answer.cameras.len(), count)?;
    if let Some(motion) = &answer.motion {
        EvalError::expect("positions of an answer, [T][T][H][W]", motion.positions.len(), count * count * pixels)?;
        EvalError::expect("scores of an answer, [T][H][W]", motion.theta.len(), count * pixels)?;
    }
    let truth: Vec<f32> = (0..count).flat_map(|image| depth_of(&sample, image)).collect();
    let rows: Vec<f64> = (0..truth.len()).map(|i| (i % pixels / sample.size()[0] as usize) as f64).collect();
    let labels = targets::moving_labels(&sample, true);
    let (mut own, mut trivial) = (Score::NONE, [Score::NONE; 3]);
    let (scale, found) = depth::best_scale(answer.depth, &truth);
    (own.abs_rel, own.delta) = found;
    (trivial[Trivial::Constant as usize].abs_rel, trivial[Trivial::Constant as usize].delta) =
        depth::best_scale(&vec![1.0; truth.len()], &truth).1;
    (trivial[Trivial::Rows as usize].abs_rel, trivial[Trivial::Rows as usize].delta) = depth::best_rows(&rows, &truth);
    [own.rotation, own.direction] = pairs::angles(answer.cameras, sample.cameras());
    let fixed = vec![answer.cameras[0]; count];
    let still = &mut trivial[Trivial::NothingMoves as usize];
    [still.rotation, still.direction] = pairs::angles(&fixed, sample.cameras());
    still.displacement = motion::displacement(&sample, &labels, None);
    still.overlap = motion::overlap(&labels, None);
    if let Some(moves) = &answer.motion {
        let frame = pairs::Frame { first: answer.cameras[0], scale };
        own.displacement = motion::displacement(&sample, &labels, Some((moves.positions, &frame)));
        own.overlap = motion::overlap(&labels, Some(moves.theta));
        own.still = motion::still(&sample, &labels, moves.positions, &frame);
    }
    Ok((own, trivial))
}

/// Answers that need no network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Trivial {
    /// Every pixel at the same distance.
    Constant,
    /// The line over the rows of the images that has the least relative error, one for all images.
    Rows,
    /// No point and no camera moves.
    NothingMoves,
}

impl Trivial {
    /// All, in order.
    pub const ALL: [Self; 3] = [Self::Constant, Self::Rows, Self::NothingMoves];

    /// As tables call it.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Constant => "constant depth",
            Self::Rows => "best plane over rows",
            Self::NothingMoves => "nothing moves",
        }
    }
}

fn depth_of(sample: &Sample, image: usize) -> Vec<f32> {
    sample.depth(image).map_or_else(|| vec![f32::NAN; sample.pixels()], <[f32]>::to_vec)
}

#[cfg(test)]
mod tests;
