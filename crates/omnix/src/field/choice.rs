//! From a field to what exports of motion take: chosen points of all images, or one image with all its pixels.

use omnix_io::Picture;
use omnix_io::output::motion::{ImageTime, MotionView, MovingPoints, SourceMotion};
use omnix_io::output::{PointOptions, choose_points};

use omnix_graph::ops::Gate;

use super::{Field, Pixels, Query};
use crate::error::OmnixError;

/// One image's motion with the buffers that [`SourceMotion`] borrows.
#[derive(Clone, Debug)]
pub struct ImageMotion {
    /// Index of the image.
    pub index: usize,
    /// `[pixels][3]`.
    pub points: Vec<f32>,
    /// `[times][pixels][3]`, if asked for.
    pub trajectory: Option<Vec<f32>>,
    /// `[pixels]`.
    pub confidence: Vec<f32>,
    /// `[pixels]`.
    pub theta: Vec<f32>,
    /// `[pixels]`.
    pub moving: Vec<bool>,
}

impl ImageMotion {
    /// As exports take it.
    #[must_use]
    pub fn as_source(&self) -> SourceMotion<'_> {
        SourceMotion {
            index: self.index,
            pixels: None,
            points: &self.points,
            trajectory: self.trajectory.as_deref(),
            confidence: &self.confidence,
            motion: &self.theta,
            moving: &self.moving,
        }
    }
}

impl Field {
    /// Cameras, times and pictures as exports take them; grey where there is no picture.
    ///
    /// # Errors
    /// A failure of reading a file.
    pub fn views(&self) -> Result<Vec<MotionView>, OmnixError> {
        let (width, height) = (self.shape().width as u32, self.shape().height as u32);
        let grey = || Picture::new(width, height, vec![128; 3 * (width * height) as usize]);
        let view = |(index, image): (usize, &super::FieldImage)| {
            Ok(MotionView {
                extrinsics: image.camera.extrinsics,
                intrinsics: image.camera.intrinsics,
                time: ImageTime { video: image.video, frame: image.frame, time_s: image.time_s },
                picture: self.picture(index)?.unwrap_or_else(grey),
            })
        };
        self.images().iter().enumerate().map(view).collect()
    }

    /// Follows `budget` pixels, the moving ones first, chosen by `seed`. Points of all images together take
    /// `12 · budget · T` bytes; nothing of T² is made.
    ///
    /// # Errors
    /// Failures of the device, of reading a file, or of `on_image`, which is called before every image.
    pub fn choose(
        &self,
        budget: usize,
        seed: u64,
        on_image: &mut dyn FnMut(usize) -> Result<(), OmnixError>,
    ) -> Result<MovingPoints, OmnixError> {
        let (shape, views) = (*self.shape(), self.views()?);
        let threshold = match self.motion().gate {
            Gate::Hard(threshold) => threshold,
            Gate::None | Gate::Blend => 0.0,
        };
        let options = PointOptions::new(budget).seed(seed).threshold(threshold);
        // A pixel that a mask leaves out has no confidence, and no score here: such are never chosen.
        let scores = |image| {
            let (theta, confidence) = (self.theta(image)?, self.confidence(image)?);
            Ok(theta.iter().zip(&*confidence).map(|(t, c)| if *c == 0.0 { f32::NAN } else { *t }).collect())
        };
        let scores = (0..shape.images).map(scores).collect::<Result<Vec<Vec<f32>>, OmnixError>>()?;
        let slices: Vec<&[f32]> = scores.iter().map(Vec::as_slice).collect();
        let chosen = choose_points(&slices, shape.width, &options);
        let count: usize = chosen.iter().map(Vec::len).sum();
        let mut points = MovingPoints {
            views,
            source: Vec::with_capacity(count),
            pixel: Vec::with_capacity(count),
            positions: vec![0.0; 3 * count * shape.images],
            colours: Vec::with_capacity(count),
            motion: Vec::with_capacity(count),
            confidence: Vec::with_capacity(count),
            moving: Vec::with_capacity(count),
        };
        for (image, pixels) in chosen.iter().enumerate().filter(|(_, pixels)| !pixels.is_empty()) {
            on_image(image)?;
            let start = points.source.len();
            let list: Vec<[u32; 2]> =
                pixels.iter().map(|p| [(p % shape.width) as u32, (p / shape.width) as u32]).collect();
            let query = Query::new(image, Pixels::List(list.clone()), 0..shape.images);
            self.stream(&query, &mut |piece| {
                let n = piece.theta.len();
                for time in 0..piece.times {
                    let to = 3 * ((piece.first_time + time) * count + start + piece.first_pixel);
                    points.positions[to..to + 3 * n]
                        .copy_from_slice(&piece.positions[3 * time * n..3 * (time + 1) * n]);
                }
                Ok(())
            })?;
            let confidence = self.pixel_values(image, &Pixels::List(list.clone()))?.confidence;
            let (theta, picture) = (&scores[image], &points.views[image].picture);
            points.colours.extend(pixels.iter().map(|p| std::array::from_fn(|c| picture.data[3 * p + c])));
            points.source.extend(pixels.iter().map(|_| image as u32));
            points.pixel.extend(list);
            points.motion.extend(pixels.iter().map(|p| theta[*p].clamp(0.0, 1.0)));
            points.confidence.extend(confidence);
            points.moving.extend(pixels.iter().map(|p| self.moves(theta[*p])));
        }
        Ok(points)
    }

    /// One image with all its pixels, and with their paths at all times if wanted: T · H · W points.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image that is not there; failures of the device or of reading a file.
    pub fn image_motion(&self, image: usize, paths: bool) -> Result<ImageMotion, OmnixError> {
        let points = self.points(image)?;
        let trajectory = if paths {
            Some(self.paths(&Query::new(image, Pixels::All, 0..self.shape().images))?.positions)
        } else {
            None
        };
        let (theta, confidence) = (self.theta(image)?.into_owned(), self.confidence(image)?.into_owned());
        let moving = theta.iter().map(|t| self.moves(*t)).collect();
        Ok(ImageMotion { index: image, points, trajectory, confidence, theta, moving })
    }
}
