//! What a run tells while it works, as one stream, and how it is broken off.

use std::ops::ControlFlow;

use omnix_geometry::{Agreement, Camera};
use omnix_kernels::BufferSlice;

use crate::error::OmnixError;
use crate::field::Field;

/// What happened, in order. A run tells its progress in each phase; every image's geometry as soon as it exists; and, where
/// trajectories are wanted, what moves in every image, and last the field.
#[derive(Debug)]
#[non_exhaustive]
pub enum Event {
    /// How far the work is.
    Progress(Progress),
    /// How known cameras and the network's own agree, where some are given. Before any geometry.
    Agreement(Agreement),
    /// Metres in a unit of the any-view network's depth, of a nested network or by a known distance. Before any geometry, which is in
    /// metres.
    MetricScale(f64),
    /// An image's geometry, on the host ([`crate::Session::run`]).
    Frame(FrameGeometry),
    /// An image's geometry, on the device ([`crate::Session::run_resident`]).
    Resident(ResidentGeometry),
    /// What moves in an image.
    Motion(FrameMotion),
    /// A window of a film begins ([`crate::windows::Windows::run`]).
    #[cfg(feature = "io")]
    Window(WindowBegun),
    /// What trajectories are evaluated from. Nothing follows.
    Field(Box<Field>),
}

/// What is called with every event. `Err(OmnixError::Interrupted)` in answer to progress breaks the work off: geometry that was
/// computed by then is still told. Any other error ends the run at once and is its result.
pub type Listener<'a> = &'a mut dyn FnMut(Event) -> Result<(), OmnixError>;

/// A listener that takes no notice of anything.
pub fn quiet() -> impl FnMut(Event) -> Result<(), OmnixError> {
    |_| Ok(())
}

/// What is being done.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// Reading, packing and uploading weights that stay while their stage runs; checking those that do not.
    Weights,
    /// The metric network of a nested one, over all images.
    Metric,
    /// The network over all images.
    Backbone,
    /// Depth, image by image.
    Head,
    /// The trajectory module over all images.
    Motion,
    /// Where each pixel samples the field, image by image.
    Sampling,
}

/// A step of long work: `done` of `total` units of its phase (bytes or operations).
#[derive(Clone, Copy, Debug)]
pub struct Progress {
    /// What is being done.
    pub phase: Phase,
    /// Units done.
    pub done: u64,
    /// Units of the whole phase.
    pub total: u64,
}

/// The results for one image.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameGeometry {
    /// Index of the image.
    pub index: usize,
    /// Depth along the camera's z axis, `[height, width]`, in the unit of [`crate::RunPlan::unit`].
    pub depth: Vec<f32>,
    /// Confidence of each depth, at least 1; none of monocular and metric networks.
    pub confidence: Option<Vec<f32>>,
    /// How much each pixel is sky, at least 0, of monocular, metric and nested networks: from 0.3 on its depth was filled in
    /// ([`omnix_geometry::fill_sky`]), from 0.5 on ([`omnix_geometry::SKY`]) results call it sky.
    pub sky: Option<Vec<f32>>,
    /// World-to-camera pose and intrinsics in pixels of the processed image; none of monocular and metric networks, unless they
    /// were given.
    pub camera: Option<Camera>,
    /// `[8·height/14, 8·width/14, 6]` direction and origin in the world, and a confidence each, if asked for.
    pub rays: Option<(Vec<f32>, Vec<f32>)>,
    /// `[height, width, 38]`: what a Gaussian head says of each pixel, if asked for; with depth and camera these are Gaussians of the
    /// world ([`omnix_geometry::GaussianMaps`]).
    pub gaussians: Option<Vec<f32>>,
    /// Block and `[height/14, width/14, channels]` of each of the encoder's features that were asked for.
    pub features: Vec<(usize, Vec<f32>)>,
}

/// The results for one image, on the device: f32, row-major, storage buffers that can also be copied from.
///
/// An image that is not the first of its chunk begins where its numbers do, which need not be a multiple of the binding
/// alignment: bind the whole buffer and pass the offset, or plan with [`crate::Request::head_images`] of 1, where offsets are 0.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct ResidentGeometry {
    /// Index of the image.
    pub index: usize,
    /// Depth `[height, width]` before [`ResidentGeometry::depth_scale`].
    pub depth: BufferSlice,
    /// Confidence `[height, width]`, as [`FrameGeometry::confidence`].
    pub confidence: Option<BufferSlice>,
    /// Sky `[height, width]`, as [`FrameGeometry::sky`].
    pub sky: Option<BufferSlice>,
    /// World-to-camera pose and intrinsics in pixels of the processed image, as [`FrameGeometry::camera`].
    pub camera: Option<Camera>,
    /// What depth is multiplied by: 1 unless cameras were given.
    pub depth_scale: f32,
    /// Rays and their confidence as in [`FrameGeometry::rays`], if asked for.
    pub rays: Option<(BufferSlice, BufferSlice)>,
    /// As [`FrameGeometry::gaussians`], before [`ResidentGeometry::depth_scale`].
    pub gaussians: Option<BufferSlice>,
    /// As [`FrameGeometry::features`].
    pub features: Vec<(usize, BufferSlice)>,
    /// World points `[height, width, 3]`, where trajectories are wanted.
    pub points: Option<BufferSlice>,
}

/// What moves in one image.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct FrameMotion {
    /// Index of the image.
    pub index: usize,
    /// Motion score θ of every pixel, `[height, width]`; [`Field::moves`] says which let their pixel move.
    pub theta: Vec<f32>,
    /// Confidence of every pixel's path, at least 1, the same at all times.
    pub confidence: Vec<f32>,
}

/// A window of a film, before it is computed.
#[cfg(feature = "io")]
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct WindowBegun {
    /// Its number, from 0.
    pub index: usize,
    /// Windows of the film.
    pub windows: usize,
    /// Its images.
    pub images: std::ops::Range<usize>,
    /// Whether its results were found, so that nothing is computed.
    pub found: bool,
}

/// Tells a listener how far work is that can only go on or break off, and keeps the listener's error for afterwards.
pub(crate) struct Teller<'a> {
    listener: Listener<'a>,
    failed: Option<OmnixError>,
}

impl<'a> Teller<'a> {
    pub(crate) fn new(listener: Listener<'a>) -> Self {
        Self { listener, failed: None }
    }

    /// `done` of `total` units of a phase.
    pub(crate) fn progress(&mut self, phase: Phase, done: u64, total: u64) -> ControlFlow<()> {
        match (self.listener)(Event::Progress(Progress { phase, done, total })) {
            Ok(()) => ControlFlow::Continue(()),
            Err(error) => {
                self.failed = Some(error);
                ControlFlow::Break(())
            }
        }
    }

    /// What became of the work: the listener's error where that broke it off.
    pub(crate) fn end<T>(self, worked: Result<T, impl Into<OmnixError>>) -> Result<T, OmnixError> {
        match (worked.map_err(Into::into), self.failed) {
            (Err(OmnixError::Interrupted), Some(error)) => Err(error),
            (worked, _) => worked,
        }
    }
}
