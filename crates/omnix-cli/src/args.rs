//! Groups of options that several commands share. The commands themselves are in `cmd`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use omnix::io::Export;
use omnix::io::preprocess::ResizeMethod;
use omnix::{Engine, FieldPrecision, OmnixError, ReferenceChoice, WeightType};

use crate::bytes;
use crate::mask_folder::MaskFolder;
use crate::ruler::Ruler;

/// Which device, shared by commands that open one.
#[derive(Debug, Clone, Args)]
pub(crate) struct DeviceArgs {
    /// Device by index or part of its name, as `omnix devices` lists them. [default: the first that will do]
    #[arg(long, value_name = "NAME|INDEX", help_heading = "Device", allow_negative_numbers = true)]
    pub(crate) device: Option<String>,
    /// Use features of the device that wgpu calls experimental: cooperative matrices (tensor cores), which about double the
    /// speed of products beside f16 and i8 weights.
    #[arg(long, help_heading = "Device")]
    pub(crate) experimental: bool,
}

impl DeviceArgs {
    /// Opens it.
    pub(crate) fn open(&self) -> Result<Engine, OmnixError> {
        let wanted = self.device.as_deref();
        if self.experimental { Engine::open_experimental(wanted) } else { Engine::open(wanted) }
    }
}

/// Options of a run.
#[derive(Debug, Clone, Args)]
pub(crate) struct RunArgs {
    /// Use at most N frames of each input, evenly spread.
    #[arg(long, value_name = "N", help_heading = "Frames", allow_negative_numbers = true)]
    pub(crate) frames: Option<usize>,
    /// Use at most F frames per second of each video; with --frames at most N of those.
    #[arg(long, value_name = "F", help_heading = "Frames", allow_negative_numbers = true)]
    pub(crate) fps: Option<f64>,
    /// Use every K-th frame of each input; with --fps or --frames those of them that are left.
    #[arg(long, value_name = "K", help_heading = "Frames", allow_negative_numbers = true)]
    pub(crate) every: Option<usize>,
    /// Leave out frames before this many seconds after a video's first one.
    #[arg(long, value_name = "SECONDS", help_heading = "Frames", allow_negative_numbers = true)]
    pub(crate) start: Option<f64>,
    /// Leave out frames after this many seconds after a video's first one.
    #[arg(long, value_name = "SECONDS", help_heading = "Frames", allow_negative_numbers = true)]
    pub(crate) end: Option<f64>,
    /// Refuse a damaged or cut-off video instead of using what can be decoded of it.
    #[arg(long, help_heading = "Frames")]
    pub(crate) strict: bool,

    /// Reconstruct a long film in windows of N images that are joined to one scene; the memory is that of N images. [default: all images
    /// at once if they fit the memory, else windows of as many as do]
    #[arg(long, value_name = "N", help_heading = "Long films", allow_negative_numbers = true)]
    pub(crate) window: Option<usize>,
    /// Images that two neighbouring windows share, by which they are joined: at most half of a window. [default: a quarter]
    #[arg(long, value_name = "M", help_heading = "Long films", allow_negative_numbers = true)]
    pub(crate) overlap: Option<usize>,

    /// Checkpoint: a folder with config.json and model.safetensors, such a file or PyTorch's, a repository in the Hugging Face hub's cache, or
    /// `nano`, the very small network inside this program.
    #[arg(long, value_name = "PATH|NAME", default_value = "nano", help_heading = "Network")]
    pub(crate) weights: String,
    /// How weights are stored on the device; f16 takes half the memory, i8 (linear layers; convolutions are f16) about a
    /// quarter and errs more. Sums are f32 either way.
    #[arg(long, value_name = "TYPE", default_value = "f32", help_heading = "Network")]
    pub(crate) weights_type: WeightsType,
    /// Which image is the reference view: first, middle, saddle_balanced, saddle_sim_range, or its index. [default: the
    /// network's own]
    #[arg(long, value_name = "WHICH", value_parser = reference, help_heading = "Network", allow_negative_numbers = true)]
    pub(crate) reference: Option<ReferenceChoice>,
    /// Where cameras come from: decoder, rays (the ray maps; about twice the work of the heads), or known ones from a file or folder: a COLMAP
    /// model, transforms.json, a TUM trajectory with intrinsics.txt beside it. Known ones are for networks with a camera encoder, and for metric
    /// networks, whose depth their focal lengths turn into metres.
    #[arg(long, value_name = "SOURCE|PATH", default_value = "decoder", value_parser = cameras, help_heading = "Network")]
    pub(crate) cameras: Cameras,

    /// One known distance, which brings all results to metres: two pixels of a picture (column and row, from 0 at the top left) and the metres
    /// between what they show, such as 007.jpg:120,300,480,310=1.85; of the first image if no picture is named.
    #[arg(long, value_name = "[PICTURE:]X,Y,X,Y=METRES", help_heading = "Network")]
    pub(crate) scale: Option<Ruler>,

    /// Masks: a folder with a picture for each input picture, 007.jpg.png or 007.png for 007.jpg, and NAME_NNNNNN.png for frame N of the video NAME.
    /// Black in a mask leaves its pixel out of every result, as in COLMAP; with still=DIR what is not black stands still, with moving=DIR it
    /// moves. May be given several times.
    #[arg(long, value_name = "[ignore=|still=|moving=]DIR", help_heading = "Masks")]
    pub(crate) masks: Vec<MaskFolder>,
    /// Leave out the pixels of pictures that are less than half opaque.
    #[arg(long, help_heading = "Masks")]
    pub(crate) alpha_masks: bool,

    /// Bound of the longest (or shortest) side in pixels. Depth Anything 3 only. [default: 504]
    #[arg(long, value_name = "N", help_heading = "Picture size", value_parser = clap::value_parser!(u32).range(14..=8192), allow_negative_numbers = true)]
    pub(crate) process_res: Option<u32>,
    /// upper_bound_resize, upper_bound_crop, lower_bound_resize or lower_bound_crop. Depth Anything 3 only. [default:
    /// upper_bound_resize]
    #[arg(long, value_name = "METHOD", help_heading = "Picture size", value_parser = method)]
    pub(crate) process_res_method: Option<ResizeMethod>,
    /// Size of the network's pictures, multiples of 14. OmniX networks only. [default: about 504x280 in the first picture's
    /// shape; for nano about 140x84, where it was trained]
    #[arg(long, value_name = "WxH", help_heading = "Picture size", value_parser = size)]
    pub(crate) size: Option<(u32, u32)>,

    // Its help is made of the list of exports.
    #[arg(long, value_name = "LIST", help_heading = "Output", value_parser = exports, help = export_help())]
    export: Option<Exports>,
    /// At most N points in ply and glb, and followed in tracks, omx4d, html and a glb that moves (those that move first).
    /// [default: all in ply, 1000000 in a still glb, 100000 followed]
    #[arg(long, value_name = "N", help_heading = "Output", value_parser = clap::value_parser!(u64).range(1..=100_000_000), allow_negative_numbers = true)]
    pub(crate) points: Option<u64>,
    /// Leave points below this percentile of confidence out of ply and glb. [default: 0 in ply, 40 in glb]
    #[arg(long, value_name = "P", help_heading = "Output", value_parser = percentile, allow_negative_numbers = true)]
    pub(crate) conf_percentile: Option<f32>,
    /// Blocks of the encoder, from 0, whose features the export `features` holds, such as 5,11. [default: the four that the heads see]
    #[arg(long, value_name = "LIST", help_heading = "Output", value_delimiter = ',')]
    pub(crate) feature_blocks: Vec<usize>,
    /// Follow every pixel in tracks: T x H x W points an image.
    #[arg(long, help_heading = "Output")]
    pub(crate) all_tracks: bool,
    /// Numbers of field.safetensors. f16 halves it; paths read from it then differ in the third digit of a pixel's place.
    #[arg(long, value_name = "TYPE", default_value = "f32", help_heading = "Output")]
    pub(crate) field_type: FieldType,

    /// Device memory that the run may take, such as 4GiB; chunks are cut to fit. [default: on software devices 80 % of the
    /// free memory of the machine or of this process's control group, whichever is less]
    #[arg(long, value_name = "SIZE", help_heading = "Device", value_parser = bytes::parse, allow_negative_numbers = true)]
    pub(crate) memory_budget: Option<u64>,
    #[command(flatten)]
    pub(crate) device: DeviceArgs,

    /// One JSON object a line on standard output, nothing for people.
    ///
    /// Its `event` is one of: note {message}; plan {images, image_size, peak_bytes, process_bytes, weight_bytes, flops, stages,
    /// field, outputs, ...}; device {name, backend, driver, kind, tier}; progress {phase:
    /// read|weights|metric|backbone|head|motion|sampling|join|exports, done, total, seconds}; cameras {scale, turned_degrees, moved} and
    /// metric_scale {metres} where there are such; frame {index, video, frame, time_s,
    /// depth_min, depth_max, seconds}; motion {index, moving, pixels}; window {index, windows, images, found}; join {windows, images,
    /// joined, ...}; done {dir, files, manifest,
    /// images, timings_s, note}; error {kind, exit_code, message, causes, help}. The last line is done or error. Sizes are
    /// [width, height] in pixels. A path that is no Unicode has U+FFFD in place of what is not.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Points that exports of motion follow, if --points does not say.
const FOLLOWED: u64 = 100_000;

impl RunArgs {
    /// Points that exports of motion follow at most.
    pub(crate) fn followed(&self) -> u64 {
        self.points.unwrap_or(FOLLOWED)
    }

    /// Whether the exports were named.
    pub(crate) fn names_exports(&self) -> bool {
        self.export.is_some()
    }

    /// What to write, of a network that has trajectories or not, and of a run that has cameras or not.
    pub(crate) fn exports(&self, trajectories: bool, cameras: bool) -> Vec<Export> {
        match &self.export {
            Some(asked) => asked.0.clone(),
            None => {
                let usual = Export::ALL.iter().copied().filter(|e| e.by_default());
                usual.filter(|e| (trajectories || !e.needs_motion()) && (cameras || !e.needs_cameras())).collect()
            }
        }
    }
}

/// `--export`, parsed.
#[derive(Debug, Clone)]
struct Exports(Vec<Export>);

/// `--field-type`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum FieldType {
    /// 32 bits.
    F32,
    /// 16 bits.
    F16,
}

impl From<FieldType> for FieldPrecision {
    fn from(value: FieldType) -> Self {
        match value {
            FieldType::F32 => Self::F32,
            FieldType::F16 => Self::F16,
        }
    }
}

/// `--weights-type`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum WeightsType {
    /// 32 bits.
    F32,
    /// 16 bits.
    F16,
    /// 8 bits for linear layers, 16 bits for convolutions.
    I8,
}

impl From<WeightsType> for WeightType {
    fn from(value: WeightsType) -> Self {
        match value {
            WeightsType::F32 => Self::F32,
            WeightsType::F16 => Self::F16,
            WeightsType::I8 => Self::I8,
        }
    }
}

/// `--cameras`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) enum Cameras {
    /// From the camera token.
    Decoder,
    /// From the ray maps.
    Rays,
    /// From a file or folder.
    Known(PathBuf),
}

#[expect(clippy::unnecessary_wraps, reason = "the form that clap asks for")]
fn cameras(text: &str) -> Result<Cameras, String> {
    Ok(match text {
        "decoder" => Cameras::Decoder,
        "rays" => Cameras::Rays,
        path => Cameras::Known(path.into()),
    })
}

fn reference(text: &str) -> Result<ReferenceChoice, String> {
    match text {
        "first" => Ok(ReferenceChoice::First),
        "middle" => Ok(ReferenceChoice::Middle),
        "saddle_balanced" => Ok(ReferenceChoice::SaddleBalanced),
        "saddle_sim_range" => Ok(ReferenceChoice::SaddleSimRange),
        index => match index.parse() {
            Ok(index) => Ok(ReferenceChoice::Forced(index)),
            Err(_) => Err("first, middle, saddle_balanced, saddle_sim_range or an index from 0".to_owned()),
        },
    }
}

fn method(text: &str) -> Result<ResizeMethod, String> {
    text.parse().map_err(|e: omnix::io::IoError| e.to_string())
}

fn exports(text: &str) -> Result<Exports, String> {
    let list = Export::parse_list(text).map_err(|e| e.to_string())?;
    if list.is_empty() { Err("name at least one, such as depth,npz,html".to_owned()) } else { Ok(Exports(list)) }
}

/// Help of `--export`.
fn export_help() -> String {
    let names = |which: &dyn Fn(&Export) -> bool| {
        Export::ALL.iter().filter(|e| which(e)).map(|e| e.name()).collect::<Vec<_>>().join(", ")
    };
    format!(
        "What to write, separated by commas: {}; where there are cameras (not of monocular and metric networks) also {}; of networks with \
         trajectories also {}. manifest.json is always written. gs_ply is for networks with a Gaussian head. [default: {}, {} where there are cameras, and {} where there are \
         trajectories]",
        names(&|e| !e.needs_motion() && !e.needs_cameras()),
        names(&|e| !e.needs_motion() && e.needs_cameras()),
        names(&|e| e.needs_motion()),
        names(&|e| e.by_default() && !e.needs_motion() && !e.needs_cameras()),
        names(&|e| e.by_default() && !e.needs_motion() && e.needs_cameras()),
        names(&|e| e.by_default() && e.needs_motion()),
    )
}

fn percentile(text: &str) -> Result<f32, String> {
    text.parse::<f32>().ok().filter(|p| (0.0..=100.0).contains(p)).ok_or_else(|| "a number from 0 to 100".to_owned())
}

pub(crate) fn size(text: &str) -> Result<(u32, u32), String> {
    let (w, h) = text.split_once(['x', 'X', '×']).ok_or("width and height, such as 504x280")?;
    let side = |text: &str| text.trim().parse::<u32>().ok().filter(|s| (14..=8192).contains(s) && s.is_multiple_of(14));
    let (Some(width), Some(height)) = (side(w), side(h)) else {
        return Err("both sides must be multiples of 14, from 14 to 8190".to_owned());
    };
    Ok((width, height))
}

/// The output folder, shared by commands that write one.
#[derive(Debug, Clone, Args)]
pub(crate) struct OutArgs {
    /// Folder for the results; made if absent. Files of the same names are replaced, others are left alone. One run at a time
    /// writes to it.
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: PathBuf,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values() {
        assert_eq!(size("504x280"), Ok((504, 280)));
        for bad in ["504", "500x280", "0x14", "14x", "9999999x14"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert!(exports("npz,nothing").is_err() && exports(",").is_err());
        assert!(percentile("nan").is_err() && percentile("101").is_err());
        assert!(reference("last").is_err());
    }
}
