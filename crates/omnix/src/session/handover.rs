//! What the stages of a run hand each other.

use omnix_geometry::Camera;
use omnix_graph::{Bindings, Tensors};
use omnix_kernels::{BufferSlice, Gpu};

use crate::error::OmnixError;

/// What the backbone leaves for the other stages.
pub(super) struct BackboneResults {
    /// `feat.0` to `feat.3` of all images, on the device.
    pub(super) features: Vec<BufferSlice>,
    /// In the world of the results.
    pub(super) cameras: Vec<Camera>,
    /// What depth is multiplied by to fit given cameras.
    pub(super) depth_scale: f32,
}

/// Copies the features of `count` of `images` images, from `first` on, into the inputs of a stage over a few images.
pub(super) fn fill(
    gpu: &Gpu,
    stage: &Tensors,
    features: &[BufferSlice],
    (first, count, images): (usize, usize, usize),
) -> Result<(), OmnixError> {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for (k, feature) in features.iter().enumerate() {
        let input = stage.slice(&format!("feat.{k}"))?;
        let image = feature.size / images as u64;
        let from = feature.offset + first as u64 * image;
        encoder.copy_buffer_to_buffer(&feature.buffer, from, &input.buffer, input.offset, count as u64 * image);
    }
    gpu.queue.submit([encoder.finish()]);
    Ok(())
}

/// The features as inputs of a stage that runs `runs` times: one that runs more than once gets copies for the images of each run.
pub(super) fn inputs(features: &[BufferSlice], runs: usize) -> Bindings {
    let named = features.iter().enumerate().map(|(k, feature)| (format!("feat.{k}"), feature.clone()));
    if runs == 1 { named.collect() } else { Bindings::default() }
}

/// Part `i` of `count` equal ones of an input or output.
pub(super) fn part(stage: &Tensors, name: &str, i: usize, count: usize) -> Result<BufferSlice, OmnixError> {
    let all = stage.slice(name)?;
    let size = all.size / count as u64;
    Ok(BufferSlice { offset: all.offset + i as u64 * size, size, buffer: all.buffer })
}
