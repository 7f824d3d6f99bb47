//! Points that move: what every export of motion takes.
//!
//! A point is a pixel of one source image, followed through all target times. Positions are in the world frame of the network
//! (OpenCV axes, the first image's camera as the network predicts it), in the network's own scale.

use crate::Picture;

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
}
