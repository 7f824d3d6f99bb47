//! Points that move: what every export of motion takes.
//!
//! A point is a pixel of one source image, followed through all target times. Positions are in the world frame of the network
//! (OpenCV axes, the first image's camera as the network predicts it), in the network's own scale.
//!
//! Two forms: [`MovingPoints`], chosen points of all images at once, and [`SourceMotion`], one source image at a time, for what
//! needs all pixels and for outputs that would be too large in one piece.

use crate::{IoError, Picture};

/// When an image was taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageTime {
    /// Index of its video.
    pub video: u32,
    /// Frame in its video.
    pub frame: u32,
    /// Seconds from the start of its video, where known.
    pub time_s: Option<f64>,
}

/// An image of the collection: its camera, its time, its processed picture.
#[derive(Clone, Debug)]
pub struct MotionView {
    /// World-to-camera.
    pub extrinsics: [[f32; 4]; 3],
    /// In pixels of `picture`, principal point included.
    pub intrinsics: [[f32; 3]; 3],
    /// When it was taken; image order is the order of target times.
    pub time: ImageTime,
    /// The processed picture; all views have one size.
    pub picture: Picture,
}

/// Chosen points with their paths. There is one target time for each view, in view order.
#[derive(Clone, Debug)]
pub struct MovingPoints {
    /// The images.
    pub views: Vec<MotionView>,
    /// Source view of each point, ascending.
    pub source: Vec<u32>,
    /// Column and row of each point in its source view.
    pub pixel: Vec<[u32; 2]>,
    /// `[views][points][3]`: where each point is at each time.
    pub positions: Vec<f32>,
    /// RGB of each point's pixel.
    pub colours: Vec<[u8; 3]>,
    /// Motion score θ of each point in 0..1.
    pub motion: Vec<f32>,
    /// Confidence of each point's path, at least 1.
    pub confidence: Vec<f32>,
    /// Whether the gate let each point move (θ above the network's threshold).
    pub moving: Vec<bool>,
}

impl MovingPoints {
    /// Number of points.
    #[must_use]
    pub fn len(&self) -> usize {
        self.source.len()
    }

    /// Whether there are none.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.source.is_empty()
    }

    /// Position of `point` at time `time`.
    ///
    /// # Panics
    /// If there is no such point or time.
    #[must_use]
    pub fn position(&self, time: usize, point: usize) -> [f32; 3] {
        let at = (time * self.len() + point) * 3;
        [self.positions[at], self.positions[at + 1], self.positions[at + 2]]
    }

    /// Checks that every buffer has the length it should and every point lies in its picture.
    pub(super) fn check(&self, export: &'static str) -> Result<(), IoError> {
        let n = self.len();
        let lengths = [
            ("pixels", self.pixel.len(), n),
            ("positions", self.positions.len(), 3 * n * self.views.len()),
            ("colours", self.colours.len(), n),
            ("motion scores", self.motion.len(), n),
            ("path confidences", self.confidence.len(), n),
            ("gates", self.moving.len(), n),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return Err(IoError::WrongSize { export, what, index: 0, expected, found });
            }
        }
        check_views(&self.views, export)?;
        let bad = |point, reason| Err(IoError::BadPoint { export, point, reason });
        for (i, (&source, &[x, y])) in self.source.iter().zip(&self.pixel).enumerate() {
            match self.views.get(source as usize) {
                None => return bad(i, "its source image is not one of the images"),
                Some(view) if x >= view.picture.width || y >= view.picture.height => {
                    return bad(i, "its pixel lies outside its picture");
                }
                Some(_) if i > 0 && self.source[i - 1] > source => return bad(i, "points are not in source order"),
                Some(_) => {}
            }
        }
        Ok(())
    }
}

/// Checks that all pictures have one size.
pub(super) fn check_views(views: &[MotionView], export: &'static str) -> Result<(), IoError> {
    let Some(first) = views.first().map(|v| &v.picture) else { return Ok(()) };
    let expected = first.data.len();
    for (index, MotionView { picture, .. }) in views.iter().enumerate() {
        if (picture.width, picture.height) != (first.width, first.height) || picture.data.len() != expected {
            let found = picture.data.len();
            return Err(IoError::WrongSize { export, what: "a picture", index, expected, found });
        }
    }
    Ok(())
}

/// The motion of one source image, of chosen pixels or of all.
#[derive(Clone, Copy, Debug)]
pub struct SourceMotion<'a> {
    /// Index of the image, which is also the index of its own time.
    pub index: usize,
    /// Columns and rows of the points; none for every pixel, row by row.
    pub pixels: Option<&'a [[u32; 2]]>,
    /// `[points][3]`: positions at the image's own time.
    pub points: &'a [f32],
    /// `[times][points][3]`: positions at every time, where they were evaluated.
    pub trajectory: Option<&'a [f32]>,
    /// `[points]`: confidence of the paths, at least 1.
    pub confidence: &'a [f32],
    /// `[points]`: motion score θ.
    pub motion: &'a [f32],
    /// `[points]`: whether the gate let the point move.
    pub moving: &'a [bool],
}

impl SourceMotion<'_> {
    /// Checks the image's number and every length; `views` are all images.
    pub(super) fn check(&self, views: &[MotionView], export: &'static str) -> Result<(), IoError> {
        let Some(view) = views.get(self.index) else {
            let what = "a number";
            let (index, found) = (self.index, self.index + 1);
            return Err(IoError::WrongSize { export, what, index, expected: views.len(), found });
        };
        let (width, height) = (view.picture.width, view.picture.height);
        let n = self.pixels.map_or(width as usize * height as usize, <[_]>::len);
        let lengths = [
            ("points", self.points.len(), 3 * n),
            ("a trajectory", self.trajectory.map_or(3 * n * views.len(), <[_]>::len), 3 * n * views.len()),
            ("path confidences", self.confidence.len(), n),
            ("motion scores", self.motion.len(), n),
            ("gates", self.moving.len(), n),
        ];
        for (what, found, expected) in lengths {
            if found != expected {
                return Err(IoError::WrongSize { export, what, index: self.index, expected, found });
            }
        }
        match self.pixels.unwrap_or_default().iter().position(|&[x, y]| x >= width || y >= height) {
            Some(point) => Err(IoError::BadPoint { export, point, reason: "its pixel lies outside its picture" }),
            None => Ok(()),
        }
    }

    /// The trajectory, or an error that names the export that needs it.
    pub(super) fn need_trajectory(&self, export: &'static str) -> Result<&[f32], IoError> {
        let missing = "the paths of its points";
        self.trajectory.ok_or(IoError::MissingField { export, missing, index: self.index })
    }

    /// An error unless the image comes with all its pixels.
    pub(super) fn need_all_pixels(&self, views: &[MotionView], export: &'static str) -> Result<(), IoError> {
        let pixels = views[self.index].picture.data.len() / 3;
        match self.pixels {
            None => Ok(()),
            Some(chosen) => Err(IoError::WrongSize {
                export,
                what: "points",
                index: self.index,
                expected: pixels,
                found: chosen.len(),
            }),
        }
    }
}
