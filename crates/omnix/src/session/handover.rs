//! What the stages of a run hand each other.

use omnix_geometry::Camera;
use omnix_graph::{Bindings, Tensors};
use omnix_kernels::{BufferSlice, Gpu};

use crate::error::OmnixError;

/// What the backbone leaves for the other stages.
pub(super) struct BackboneResults {
    /// `feat.0` to `feat.3` of all images, on the device.
    pub(super) features: Vec<BufferSlice>,
    /// All images, where the head sees them too.
    pub(super) pictures: Option<BufferSlice>,
    /// Block and features of all images, the images in the order of `places`.
    pub(super) exports: Vec<(usize, BufferSlice)>,
    /// Where each image is inside the encoder.
    pub(super) places: Vec<usize>,
    /// In the world of the results; none of networks without.
    pub(super) cameras: Vec<Camera>,
    /// What depth is multiplied by to fit given cameras.
    pub(super) depth_scale: f32,
}

impl BackboneResults {
    /// Block and features of one image.
    pub(super) fn exports_of(&self, image: usize) -> Vec<(usize, BufferSlice)> {
        let images = self.places.len() as u64;
        let of = |(block, all): &(usize, BufferSlice)| {
            let size = all.size / images;
            let offset = all.offset + self.places[image] as u64 * size;
            (*block, BufferSlice { offset, size, buffer: all.buffer.clone() })
        };
        self.exports.iter().map(of).collect()
    }
}

/// Where each of `images` images is where this one comes first and the others follow in order.
pub(super) fn places(images: usize, first: usize) -> Vec<usize> {
    let place = |image: usize| match image {
        _ if image == first => 0,
        _ if image < first => image + 1,
        _ => image,
    };
    (0..images).map(place).collect()
}

/// Copies the features, and pictures, of `count` of `images` images, from `first` on, into the inputs of a stage over a few images.
pub(super) fn fill(
    gpu: &Gpu,
    stage: &Tensors,
    (features, pictures): (&[BufferSlice], Option<&BufferSlice>),
    (first, count, images): (usize, usize, usize),
) -> Result<(), OmnixError> {
    let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    for (name, all) in named(features, pictures) {
        let input = stage.slice(&name)?;
        let image = all.size / images as u64;
        let from = all.offset + first as u64 * image;
        encoder.copy_buffer_to_buffer(&all.buffer, from, &input.buffer, input.offset, count as u64 * image);
    }
    gpu.queue.submit([encoder.finish()]);
    Ok(())
}

/// The features, and pictures, as inputs of a stage that runs `runs` times: one that runs more than once gets copies for the images of
/// each run.
pub(super) fn inputs(features: &[BufferSlice], pictures: Option<&BufferSlice>, runs: usize) -> Bindings {
    let named = named(features, pictures).map(|(name, all)| (name, all.clone()));
    if runs == 1 { named.collect() } else { Bindings::default() }
}

/// What a stage over a few images reads, by the names of its inputs.
fn named<'a>(
    features: &'a [BufferSlice],
    pictures: Option<&'a BufferSlice>,
) -> impl Iterator<Item = (String, &'a BufferSlice)> {
    let features = features.iter().enumerate().map(|(k, feature)| (format!("feat.{k}"), feature));
    features.chain(pictures.map(|pictures| ("pictures".to_owned(), pictures)))
}

/// Part `i` of `count` equal ones of an input or output.
pub(super) fn part(stage: &Tensors, name: &str, i: usize, count: usize) -> Result<BufferSlice, OmnixError> {
    let all = stage.slice(name)?;
    let size = all.size / count as u64;
    Ok(BufferSlice { offset: all.offset + i as u64 * size, size, buffer: all.buffer })
}
