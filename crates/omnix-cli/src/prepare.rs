//! How pictures are brought to the network's size: Depth Anything 3's way or OmniX's, chosen by the checkpoint.

use omnix::io::cameras::MatchedCamera;
use omnix::io::preprocess::{
    Da3Preprocess, Framing, OmnixPreprocess, PATCH, Processed, ResizeMethod, centre_crop, common_size,
};
use omnix::io::{InputPlan, IoError, Picture, PlannedFrame};
use omnix::model::config::Family;
use omnix::{Camera, Weights};
use serde_json::{Value, json};

use crate::args::RunArgs;
use crate::error::CliError;

/// Patches of 504x280 pixels.
const PATCHES: f64 = 36.0 * 20.0;
/// Patches of 140x84 pixels, near those where the embedded network was trained: 112x84 and 84x112.
const PATCHES_NANO: f64 = 10.0 * 6.0;
/// Patches of 84x112 pixels, the tallest pictures that the embedded network was trained with.
const PATCHES_NANO_TALL: f64 = 6.0 * 8.0;

/// Share of a picture below which so little of it is kept that its owner is told.
const MUCH: f64 = 0.8;

/// Settings and the one size of a run.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Preparation {
    /// Bound a side, go to multiples of 14, crop to the smallest size of the batch.
    DepthAnything {
        /// The first two steps.
        steps: Da3Preprocess,
        /// Width and height after the last.
        common: (u32, u32),
    },
    /// Cover a fixed size and crop.
    OmniX(OmnixPreprocess),
}

impl Preparation {
    /// Chooses by the network and finds the size, without decoding anything.
    pub(crate) fn new(weights: &Weights, args: &RunArgs, input: &InputPlan) -> Result<Self, CliError> {
        if let Some(frame) = input.frames.iter().find(|f| f.width.min(f.height) < PATCH) {
            let (width, height, path) = (frame.width, frame.height, frame.path.clone());
            return Err(CliError::TinyPicture { width, height, path });
        }
        match weights.network().config().family {
            Family::DepthAnything3 => {
                if args.size.is_some() {
                    return Err(CliError::Usage(
                        "--size is for OmniX networks; this is Depth Anything 3: use --process-res N".to_owned(),
                    ));
                }
                let steps = Da3Preprocess {
                    process_res: args.process_res.unwrap_or(504),
                    method: args.process_res_method.unwrap_or(ResizeMethod::UpperBoundResize),
                };
                let sizes: Result<Vec<_>, IoError> =
                    input.frames.iter().map(|f| steps.output_size(f.width, f.height)).collect();
                let common = common_size(sizes?).unwrap_or((PATCH, PATCH));
                Ok(Self::DepthAnything { steps, common })
            }
            Family::OmniX => {
                let method = args.process_res_method.map(|_| "--process-res-method");
                if let Some(option) = args.process_res.map(|_| "--process-res").or(method) {
                    return Err(CliError::Usage(format!(
                        "{option} is for Depth Anything 3; this is an OmniX network: use --size WxH"
                    )));
                }
                let shape = input.frames.first().map_or((504, 280), |f| (f.width, f.height));
                let (width, height) = args.size.unwrap_or_else(|| usual_size(weights, shape));
                Ok(Self::OmniX(OmnixPreprocess { width, height }))
            }
        }
    }

    /// Width and height of every processed picture.
    pub(crate) fn size(&self) -> (u32, u32) {
        match self {
            Self::DepthAnything { common, .. } => *common,
            Self::OmniX(steps) => (steps.width, steps.height),
        }
    }

    /// How a frame's picture comes to that size.
    pub(crate) fn framing(&self, frame: &PlannedFrame) -> Framing {
        let (width, height) = (frame.width, frame.height);
        let framing = match self {
            Self::DepthAnything { steps, common } => steps.framing(width, height, *common),
            Self::OmniX(steps) => steps.framing(width, height),
        };
        // A size that cannot be had is an error of reading the picture; until then nothing of it is kept.
        framing.unwrap_or(Framing { resized: (width, height), crop: [0; 4] })
    }

    /// A frame's known camera, for the picture that the network sees.
    pub(crate) fn camera(&self, frame: &PlannedFrame, known: &MatchedCamera) -> Camera {
        let framing = self.framing(frame);
        let (resized, [left, top, ..]) = (framing.resized, framing.crop);
        let lens = known.lens.resized([frame.width, frame.height], [resized.0, resized.1]);
        let mut intrinsics = lens.intrinsics([resized.0, resized.1]);
        intrinsics[0][2] -= left as f32;
        intrinsics[1][2] -= top as f32;
        Camera { extrinsics: known.world_to_camera, intrinsics }
    }

    /// Where a place of a frame's picture is in what the network sees of it, both in pixels with whole numbers at their middles; none where it
    /// is cut off.
    pub(crate) fn place(&self, frame: &PlannedFrame, [x, y]: [f64; 2]) -> Option<[f32; 2]> {
        let Framing { resized, crop: [left, top, width, height] } = self.framing(frame);
        let at = |place: f64, from: u32, to: u32, cut: u32| {
            (place + 0.5) * f64::from(to) / f64::from(from) - f64::from(cut) - 0.5
        };
        let (x, y) = (at(x, frame.width, resized.0, left), at(y, frame.height, resized.1, top));
        let inside = |place: f64, side: u32| (-0.5..f64::from(side) - 0.5).contains(&place);
        (inside(x, width) && inside(y, height)).then_some([x as f32, y as f32])
    }

    /// Says it where pictures lose much to the common shape.
    pub(crate) fn note(&self, input: &InputPlan) -> Option<String> {
        let kept = |frame: &PlannedFrame| self.framing(frame).kept();
        let cut = input.frames.iter().filter(|f| kept(f) < MUCH).count();
        let worst = input.frames.iter().min_by(|a, b| kept(a).total_cmp(&kept(b))).filter(|_| cut > 0)?;
        let (width, height) = self.size();
        let lost = 100.0 * (1.0 - kept(worst));
        Some(format!(
            "{cut} of {} image(s) are cropped to the common shape of {width}x{height}; {} loses {lost:.0} % of its picture: \
             reconstruct pictures of one shape together, or choose the size",
            input.frames.len(),
            worst.path.display(),
        ))
    }

    /// One picture at the network's size.
    pub(crate) fn apply(&self, picture: &Picture) -> Result<Picture, IoError> {
        match self {
            Self::DepthAnything { steps, common } => {
                let processed: Processed = steps.apply(picture, None)?;
                Ok(centre_crop(processed, *common).picture)
            }
            Self::OmniX(steps) => steps.apply(picture),
        }
    }

    /// For the manifest.
    pub(crate) fn settings(&self) -> Value {
        let (width, height) = self.size();
        match self {
            Self::DepthAnything { steps, .. } => json!({
                "kind": "depth_anything_3", "process_res": steps.process_res,
                "process_res_method": steps.method.name(), "size": [width, height],
            }),
            Self::OmniX(_) => json!({ "kind": "omnix", "size": [width, height] }),
        }
    }
}

/// The size at which a network takes pictures of this width and height, if nobody says another: about as many pixels as it was trained
/// with, in their shape.
pub(crate) fn usual_size(weights: &Weights, shape: (u32, u32)) -> (u32, u32) {
    match weights.note() {
        Some(_) if 4 * u64::from(shape.0) < 3 * u64::from(shape.1) => fitting((3, 4), PATCHES_NANO_TALL),
        Some(_) => fitting(shape, PATCHES_NANO),
        None => fitting(shape, PATCHES),
    }
}

/// Multiples of 14 of nearly the shape `width` x `height`, about `patches` patches in all: the pair with the least sum of
/// both relative differences.
fn fitting((width, height): (u32, u32), patches: f64) -> (u32, u32) {
    let aspect = f64::from(width) / f64::from(height);
    let off = |&(w, h): &(u32, u32)| {
        let (w, h) = (f64::from(w), f64::from(h));
        (w / h / aspect).ln().abs() + (w * h / patches).ln().abs()
    };
    let most = patches as u32;
    let pairs = (1..=most).flat_map(|h| {
        let w = (patches / f64::from(h)) as u32;
        [w, w + 1].into_iter().filter(|w| *w > 0).map(move |w| (w, h))
    });
    let (w, h) = pairs.min_by(|a, b| off(a).total_cmp(&off(b))).unwrap_or((1, 1));
    (w * PATCH, h * PATCH)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn default_sizes() {
        assert_eq!(fitting((1920, 1152), PATCHES_NANO), (140, 84));
        assert_eq!(fitting((3, 4), PATCHES_NANO_TALL), (84, 112));
        assert_eq!(fitting((504, 280), PATCHES), (504, 280));
        let (w, h) = fitting((480, 852), PATCHES_NANO);
        assert!(w < h && w % 14 == 0 && (40..=80).contains(&(w / 14 * (h / 14))), "{w}x{h}");
        assert_eq!(fitting((14, 100_000), PATCHES_NANO), (14, 840));
    }
}
