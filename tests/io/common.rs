//! Small files and results to test with.

use std::path::{Path, PathBuf};

use omnix_io::{FrameResult, Picture};
use safetensors::SafeTensors;

/// The copies in the repository.
pub(crate) fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/io").join(name)
}

/// The whole collection, where a checkout has it beside it.
pub(crate) fn shared(name: &str) -> Option<PathBuf> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared").join(name);
    path.exists().then_some(path)
}

/// An 8-bit picture `[H, W, 3]` of a safetensors file.
pub(crate) fn picture(tensors: &SafeTensors<'_>, name: &str) -> Picture {
    let tensor = tensors.tensor(name).unwrap();
    let [height, width, 3] = tensor.shape() else { panic!("{name} is {:?}", tensor.shape()) };
    Picture::new(*width as u32, *height as u32, tensor.data().to_vec())
}

/// f32 values of a safetensors file.
pub(crate) fn floats(tensors: &SafeTensors<'_>, name: &str) -> Vec<f32> {
    tensors.tensor(name).unwrap().data().chunks_exact(4).map(|b| f32::from_le_bytes(b.try_into().unwrap())).collect()
}

/// A picture with structure in every channel.
pub(crate) fn pattern(width: u32, height: u32) -> Picture {
    let data = (0..height)
        .flat_map(|y| (0..width).flat_map(move |x| [(x * 7 + y) as u8, (y * 11) as u8, ((x ^ y) * 5) as u8]))
        .collect();
    Picture::new(width, height, data)
}

/// Writes a picture; the extension decides the format.
pub(crate) fn save(picture: &Picture, path: &Path) {
    std::fs::create_dir_all(path.parent().unwrap()).unwrap();
    image::save_buffer(path, &picture.data, picture.width, picture.height, image::ColorType::Rgb8).unwrap();
}

/// A made-up result: a slanted plane, one hole, one infinite pixel, one of sky, a camera that moves along x.
pub(crate) struct Made {
    pub(crate) width: u32,
    pub(crate) height: u32,
    pub(crate) depth: Vec<f32>,
    pub(crate) confidence: Vec<f32>,
    pub(crate) rgb: Vec<u8>,
    pub(crate) sky: Vec<bool>,
}

impl Made {
    pub(crate) fn new(width: u32, height: u32) -> Self {
        let pixels = (width * height) as usize;
        let mut depth: Vec<f32> = (0..pixels).map(|i| 2.0 + 0.001 * i as f32).collect();
        depth[0] = 0.0;
        depth[1] = f32::INFINITY;
        let confidence = (0..pixels).map(|i| 1.0 + (i % 10) as f32 * 0.1).collect();
        let mut sky = vec![false; pixels];
        sky[2] = true;
        Self { width, height, depth, confidence, rgb: pattern(width, height).data, sky }
    }

    /// The result of image `index`, frame `frame` of `video`.
    pub(crate) fn frame(&self, index: usize, video: u32, frame: u32) -> FrameResult<'_> {
        let (w, h) = (self.width as f32, self.height as f32);
        FrameResult {
            index,
            video,
            frame,
            time_s: Some(f64::from(frame) / 30.0),
            width: self.width,
            height: self.height,
            depth: &self.depth,
            confidence: Some(&self.confidence),
            rgb: &self.rgb,
            extrinsics: Some([[1.0, 0.0, 0.0, -0.25 * index as f32], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]),
            intrinsics: Some([[w, 0.0, w / 2.0], [0.0, w, h / 2.0], [0.0, 0.0, 1.0]]),
            sky: Some(&self.sky),
            gaussians: None,
            features: &[],
            source: None,
        }
    }
}
