//! Arguments of `omnix render`, and what their values are.

use std::path::PathBuf;

use clap::{Args, ValueEnum};

use crate::args::DeviceArgs;
use crate::bytes;

/// Arguments of `omnix render`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct RenderArgs {
    /// Output folder of a run with `--export field` (what moves, too) or `npz`; field.safetensors itself; or a scene that `omnix data check`
    /// reads, whose truth is shown.
    #[arg(value_name = "RUN")]
    pub(super) input: PathBuf,
    /// FILE.mp4 for a film, FILE.png for one picture, else a folder for 000000.png and so on.
    #[arg(short, long, value_name = "PATH")]
    pub(super) out: PathBuf,
    /// Who looks: input (the cameras of the images), spline (their way without its shake), still (one of them), orbit (around what it sees),
    /// or a JSON file of cameras to fly along: {"keys": [{"position": [x, y, z], "target": [x, y, z]}, ..]}, each with "up", "fov" (degrees, from
    /// top to bottom) and "time" if wanted.
    #[arg(long, value_name = "WHO|PATH.json", default_value = "orbit", value_parser = view)]
    pub(super) view: View,
    /// Image whose camera still and orbit start from. [default: the middle one]
    #[arg(long, value_name = "I", help_heading = "View")]
    pub(super) image: Option<usize>,
    /// Carries the camera of still and orbit so far to the right around what it sees, in degrees.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = degrees, help_heading = "View", allow_negative_numbers = true)]
    pub(super) yaw: f64,
    /// Carries it up.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = degrees, help_heading = "View", allow_negative_numbers = true)]
    pub(super) pitch: f64,
    /// Times as far from what it sees as the image's camera. [default: 1 for still, 1.35 for orbit]
    #[arg(long, value_name = "X", value_parser = factor, help_heading = "View")]
    pub(super) away: Option<f64>,
    /// How far orbit goes to each side; 180 and more is a full circle.
    #[arg(long, value_name = "DEGREES", default_value_t = 15.0, value_parser = degrees, help_heading = "View")]
    pub(super) swing: f64,
    /// Focal length, in times that with which the whole image fills the picture.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = factor, help_heading = "View")]
    pub(super) zoom: f64,

    /// Times of the film: A..B (without B), or some, a comma between. [default: all; for one picture the last]
    #[arg(long, value_name = "TIMES", help_heading = "Time")]
    pub(super) times: Option<String>,
    /// Pictures between two times, where points go straight.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(0..=1000), help_heading = "Time", allow_negative_numbers = true)]
    pub(super) between: u32,
    /// Pictures in all, evenly spread over the times, in place of --between. [default: 96 where there is one time and the camera moves]
    #[arg(long, value_name = "N", conflicts_with = "between", value_parser = clap::value_parser!(u32).range(1..=100_000), help_heading = "Time", allow_negative_numbers = true)]
    pub(super) frames: Option<u32>,
    /// Pictures a second of a film.
    #[arg(long, value_name = "F", default_value_t = 24.0, value_parser = rate, help_heading = "Time", allow_negative_numbers = true)]
    pub(super) fps: f64,

    /// Size of the pictures.
    #[arg(long, value_name = "WxH", default_value = "1280x720", value_parser = size, help_heading = "Look")]
    pub(super) size: [u32; 2],
    /// all: points of all images, each where it is at the time; nearest: those of the image nearest in time.
    #[arg(long, value_name = "WHICH", default_value = "all", help_heading = "Look")]
    pub(super) show: Show,
    /// Video of a scene or run; scenes show one. [default: 0 of a scene, all of a run]
    #[arg(long, value_name = "V", help_heading = "Look")]
    pub(super) video: Option<usize>,
    /// At most N points; of more, every n-th is drawn, larger.
    #[arg(long, value_name = "N", default_value_t = 20_000_000, value_parser = clap::value_parser!(u64).range(1..=200_000_000), help_heading = "Look", allow_negative_numbers = true)]
    pub(super) points: u64,
    /// Leave points below this percentile of their image's confidence out.
    #[arg(long, value_name = "P", default_value_t = 0.0, value_parser = percentile, help_heading = "Look", allow_negative_numbers = true)]
    pub(super) conf_percentile: f32,
    /// Times as large as it takes to close holes.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = factor, help_heading = "Look")]
    pub(super) splat: f64,
    /// Trails of about N points that move.
    #[arg(long, value_name = "N", default_value_t = 400, value_parser = clap::value_parser!(u32).range(0..=20_000), help_heading = "Look", allow_negative_numbers = true)]
    pub(super) trails: u32,
    /// Times that a trail goes back.
    #[arg(long, value_name = "T", default_value_t = 8.0, value_parser = factor, help_heading = "Look")]
    pub(super) trail_length: f64,
    /// Frusta of the images' cameras; auto: where the view is not theirs.
    #[arg(long, value_name = "WHEN", default_value = "auto", help_heading = "Look")]
    pub(super) frusta: Frusta,
    /// white, black, none (PNG only) or RRGGBB.
    #[arg(long, value_name = "COLOUR", default_value = "white", value_parser = background, help_heading = "Look")]
    pub(super) background: Background,

    /// Memory that it may take, such as 4GiB. [default: on software devices 80 % of what is free]
    #[arg(long, value_name = "SIZE", help_heading = "Device", value_parser = bytes::parse, allow_negative_numbers = true)]
    pub(super) memory_budget: Option<u64>,
    #[command(flatten)]
    pub(super) device: DeviceArgs,
    /// One JSON object a line on standard output: note {message}, plan {pictures, size, images, points, peak_bytes, process_bytes}, progress {phase:
    /// read|render, done, total, seconds}, done {out, pictures, points, moving, trails, seconds} or error.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Show {
    All,
    Nearest,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(super) enum Frusta {
    Auto,
    Yes,
    No,
}

/// `--background`: a colour, or none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Background(pub(super) Option<[u8; 3]>);

fn background(text: &str) -> Result<Background, String> {
    let hex = text.trim_start_matches('#');
    Ok(Background(match text {
        "white" => Some([255; 3]),
        "black" => Some([0; 3]),
        "none" => None,
        _ => match u32::from_str_radix(hex, 16) {
            Ok(value) if hex.len() == 6 && hex.bytes().all(|b| b.is_ascii_hexdigit()) => {
                let [_, r, g, b] = value.to_be_bytes();
                Some([r, g, b])
            }
            _ => return Err("white, black, none, or six digits such as 1a1c20".to_owned()),
        },
    }))
}

fn number(text: &str, least: f64, most: f64) -> Result<f64, String> {
    let value = text.parse::<f64>().ok().filter(|v| (least..=most).contains(v));
    value.ok_or_else(|| format!("a number from {least} to {most}"))
}

fn degrees(text: &str) -> Result<f64, String> {
    number(text, -360.0, 360.0)
}

fn factor(text: &str) -> Result<f64, String> {
    number(text, 0.01, 100.0)
}

fn rate(text: &str) -> Result<f64, String> {
    number(text, 0.1, 240.0)
}

fn percentile(text: &str) -> Result<f32, String> {
    number(text, 0.0, 100.0).map(|v| v as f32)
}

/// Smaller pictures have no use, and the encoder wants two rows; larger ones no renderer takes.
const SIDES: std::ops::RangeInclusive<u32> = 16..=16_384;

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides =
        text.split_once(['x', 'X', '×']).and_then(|(w, h)| Some([w.trim().parse().ok()?, h.trim().parse().ok()?]));
    match sides {
        Some(sides) if sides.iter().all(|side| SIDES.contains(side)) => Ok(sides),
        _ => Err(format!("width and height from {} to {}, such as 1280x720", SIDES.start(), SIDES.end())),
    }
}

/// `--view`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum View {
    Input,
    Spline,
    Still,
    Orbit,
    Keys(PathBuf),
}

fn view(text: &str) -> Result<View, String> {
    Ok(match text {
        "input" => View::Input,
        "spline" => View::Spline,
        "still" => View::Still,
        "orbit" => View::Orbit,
        path if path.ends_with(".json") => View::Keys(path.into()),
        _ => return Err("input, spline, still, orbit, or a file that ends in .json".to_owned()),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values() {
        assert_eq!(size("1280x720"), Ok([1280, 720]));
        for bad in ["0x720", "1280", "99999x9", "8x8", "-3x40", "1e3x20"] {
            assert!(size(bad).is_err(), "{bad}");
        }
        assert_eq!(background("1a1c20"), Ok(Background(Some([0x1a, 0x1c, 0x20]))));
        assert_eq!((background("none"), background("white")), (Ok(Background(None)), Ok(Background(Some([255; 3])))));
        assert!(background("grey").is_err() && background("12345").is_err() && background("+12345").is_err());
        assert_eq!((view("input"), view("a.json")), (Ok(View::Input), Ok(View::Keys("a.json".into()))));
        assert!(view("sideways").is_err());
        assert!(factor("0").is_err() && factor("nan").is_err() && rate("1e9").is_err() && degrees("400").is_err());
    }
}
