//! What a model is made of, beside its points.

use glam::{DQuat, DVec3};

/// An image of the model.
pub(super) struct Image {
    pub(super) name: String,
    pub(super) size: [u32; 2],
    /// fx, fy, cx, cy at that size.
    pub(super) pinhole: [f64; 4],
    /// World-to-camera.
    pub(super) rotation: DQuat,
    pub(super) translation: DVec3,
    /// Where it sees points: x, y in pixels of the source picture, and the point's place in the cloud.
    pub(super) seen: Vec<([f64; 2], u32)>,
}
