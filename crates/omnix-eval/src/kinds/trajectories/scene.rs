//! One scene: prediction and truth brought together pixel by pixel, and scored in every way.

use std::path::Path;

use super::prediction::ScenePrediction;
use super::truth::SceneTruth;
use crate::files::tracks::PixelSet;
use crate::stats::mean_of_numbers;
use crate::tracks::dense::{DenseScale, DenseScore, Frame, SourceImage, VideoScale, mean, score, score_by_time};
use crate::tracks::{METRIC_RESOLUTION, mean_focal};
use crate::{EvalError, Rigid};

/// Which source images, which of their pixels, and how they are compared.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Way {
    first_image: bool,
    foreground: bool,
    how: How,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum How {
    PerImage,
    PerVideo,
    SourceCamera,
    NothingMoves,
}

pub(super) fn ways() -> Vec<Way> {
    let mut all = Vec::new();
    for how in [How::PerImage, How::NothingMoves, How::PerVideo, How::SourceCamera] {
        for (first_image, foreground) in [(false, false), (false, true), (true, false), (true, true)] {
            all.push(Way { first_image, foreground, how });
        }
    }
    all
}

impl Way {
    pub(super) fn name(self) -> String {
        let images = if self.first_image { "first image" } else { "all images" };
        let pixels = if self.foreground { "FG" } else { "ALL" };
        let how = match self.how {
            How::PerImage => "one scale per image",
            How::PerVideo => "one scale per scene",
            How::SourceCamera => "source camera, one scale per image",
            How::NothingMoves => "as if nothing moved, one scale per image",
        };
        format!("{images}, {pixels}, {how}")
    }
}

/// A scene's result.
pub(super) struct Found {
    /// Source images that have a prediction.
    pub(super) images: usize,
    /// For each way the mean over source images; none if no pixel was scored.
    pub(super) by_way: Vec<Option<DenseScore>>,
    /// Mean distance at each time, under the first way.
    pub(super) by_time: Vec<f64>,
    pub(super) notes: Vec<String>,
}

/// A source image, prediction and truth pixel by pixel in the frames of their first cameras.
struct Pair {
    truth: Vec<[f64; 3]>,
    predicted: Vec<[f64; 3]>,
    moving: Vec<bool>,
    known: Vec<bool>,
    world_to_camera: Rigid,
    predicted_world_to_camera: Rigid,
    focal: f64,
}

impl Pair {
    fn image<'a>(&'a self, predicted: &'a [[f64; 3]], foreground: bool) -> SourceImage<'a> {
        SourceImage {
            truth: &self.truth,
            predicted,
            mask: if foreground { &self.moving } else { &self.known },
            world_to_camera: self.world_to_camera,
            predicted_world_to_camera: self.predicted_world_to_camera,
            focal: self.focal,
        }
    }
}

/// Scores a scene in every way.
pub(super) fn scene(prediction: &mut dyn ScenePrediction, truth: &dyn SceneTruth) -> Result<Found, EvalError> {
    let images = truth.images();
    let poses = truth.poses()?;
    let sources = prediction.sources()?;
    if let Some(&beyond) = sources.iter().find(|&&index| index >= images) {
        return Err(EvalError::counts("images", beyond + 1, images));
    }
    let mut video = VideoScale::default();
    for index in &sources {
        let pair = pair(*index, prediction, truth, &poses)?;
        video.add(&pair.image(&pair.predicted, false))?;
    }
    let video = DenseScale::Given(video.scale().unwrap_or(f64::NAN));
    let ways = ways();
    let mut scores: Vec<Vec<DenseScore>> = vec![Vec::new(); ways.len()];
    let mut by_time = vec![Vec::new(); images];
    for index in &sources {
        let pair = pair(*index, prediction, truth, &poses)?;
        let pixels = pair.known.len();
        let own = &pair.predicted[index * pixels..(index + 1) * pixels];
        let still: Vec<[f64; 3]> = own.iter().copied().cycle().take(pair.predicted.len()).collect();
        for (k, way) in ways.iter().enumerate().filter(|(_, way)| *index == 0 || !way.first_image) {
            let (predicted, frame, scale) = match way.how {
                How::PerImage => (&pair.predicted, Frame::World, DenseScale::PerImage),
                How::PerVideo => (&pair.predicted, Frame::World, video),
                How::SourceCamera => (&pair.predicted, Frame::SourceCamera, DenseScale::PerImage),
                How::NothingMoves => (&still, Frame::World, DenseScale::PerImage),
            };
            let image = pair.image(predicted, way.foreground);
            if k == 0 {
                if let Some((score, distances)) = score_by_time(&image, frame, scale)? {
                    scores[k].push(score);
                    distances.iter().enumerate().for_each(|(time, distance)| by_time[time].push(*distance));
                }
            } else {
                scores[k].extend(score(&image, frame, scale)?);
            }
        }
    }
    let by_way: Vec<Option<DenseScore>> = scores.iter().map(|scores| mean(scores)).collect();
    if by_way[0].is_none() {
        return Err(EvalError::Nothing {
            reason: "no pixel of its source images has a known position at any time".into(),
        });
    }
    let mut notes = Vec::new();
    if sources.len() < images {
        notes.push(format!("{} of {images} source images have no prediction and are left out", images - sources.len()));
    }
    let empty = sources.len() - scores[1].len();
    if empty > 0 {
        notes.push(format!("{empty} source images have no moving pixel and are left out of FG"));
    }
    let by_time = by_time.iter().map(|d| mean_of_numbers(d.iter().copied()).0).collect();
    Ok(Found { images: sources.len(), by_way, by_time, notes })
}

/// Reads a source image of both.
fn pair(
    index: usize,
    prediction: &mut dyn ScenePrediction,
    truth: &dyn SceneTruth,
    poses: &[Rigid],
) -> Result<Pair, EvalError> {
    let predicted = prediction.source(index)?;
    EvalError::expect("images and times", predicted.times, truth.images())?;
    let (mut points, moving) = truth.source(index)?;
    let [width, height] = truth.size();
    EvalError::expect("pixels of the truth", points.len(), truth.images() * width * height)?;
    let (from, known) = places(&predicted.pixels, [width, height], &prediction.place(index))?;
    let (to_first, to_first_predicted) = (poses[0], predicted.extrinsics[0]);
    points.iter_mut().for_each(|point| *point = to_first.apply(*point));
    let count = predicted.count();
    let at = |time: usize| {
        let own = &predicted.points[time * count..(time + 1) * count];
        from.iter().map(|place| place.map_or([f64::NAN; 3], |place| to_first_predicted.apply(own[place])))
    };
    let aligned: Vec<[f64; 3]> = (0..predicted.times).flat_map(at).collect();
    let factor = METRIC_RESOLUTION / width.min(height) as f64;
    Ok(Pair {
        truth: points,
        predicted: aligned,
        moving: moving.iter().zip(&known).map(|(moves, known)| *moves && *known).collect(),
        known,
        world_to_camera: poses[index].after(&to_first.inverse()),
        predicted_world_to_camera: predicted.extrinsics[index].after(&to_first_predicted.inverse()),
        focal: mean_focal(truth.focal(index)?.map(|f| f * factor))?,
    })
}

/// For each pixel of the truth the place of its prediction, and whether it has one.
fn places(pixels: &PixelSet, size: [usize; 2], path: &Path) -> Result<(Vec<Option<usize>>, Vec<bool>), EvalError> {
    let [width, height] = size;
    let found: Vec<Option<usize>> = match pixels {
        PixelSet::All([w, h]) => {
            // The same part of the scene: sides in the same ratio, up to the rounding to whole patches.
            let ratio = (*w as f64 * height as f64) / (*h as f64 * width as f64);
            if !(0.95..1.05).contains(&ratio) {
                let reason = format!(
                    "{w} x {h} pixels are another shape than the truth's {width} x {height}; run with --size {width}x{height}"
                );
                return Err(EvalError::format("prediction", reason, path));
            }
            let near = |k: usize, from: usize, to: usize| ((2 * k + 1) * to / (2 * from)).min(to - 1);
            (0..width * height).map(|k| Some(near(k / width, height, *h) * w + near(k % width, width, *w))).collect()
        }
        PixelSet::List(list) => {
            let mut found = vec![None; width * height];
            for (place, [x, y]) in list.iter().enumerate() {
                if *x >= width || *y >= height {
                    let reason = format!(
                        "pixel ({x}, {y}) is outside of the truth's {width} x {height}; run with --size {width}x{height}"
                    );
                    return Err(EvalError::format("prediction", reason, path));
                }
                found[y * width + x] = Some(place);
            }
            found
        }
    };
    let known = found.iter().map(Option::is_some).collect();
    Ok((found, known))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn other_sizes_are_read_at_the_nearest_pixel() {
        let path = Path::new("x.npz");
        let (found, known) = places(&PixelSet::All([8, 4]), [4, 2], path).unwrap();
        assert_eq!(found[..5], [Some(9), Some(11), Some(13), Some(15), Some(25)]);
        assert!(known.iter().all(|k| *k));
        assert!(places(&PixelSet::All([8, 8]), [4, 2], path).unwrap_err().to_string().contains("--size 4x2"));
        let (found, known) = places(&PixelSet::List(vec![[3, 1]]), [4, 2], path).unwrap();
        assert_eq!((found[7], known.iter().filter(|k| **k).count()), (Some(0), 1));
        assert!(places(&PixelSet::List(vec![[4, 0]]), [4, 2], path).is_err());
    }
}
