//! `omnix query`: paths of points from a saved field, without computing any others.

mod saved;

use std::io::Read as _;
use std::path::{Path, PathBuf};

use clap::Args;
use omnix::io::input::load_picture;
use omnix::io::output::motion::ImageTime;
use omnix::io::output::paths::PathTable;
use omnix::{OmnixError, Pixels};
use serde_json::json;

use crate::args::DeviceArgs;
use crate::error::CliError;
use crate::ui::{self, Ui};
use saved::Saved;

/// Arguments of `omnix query`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct QueryArgs {
    /// field.safetensors of a run with `--export field`. Of a film in windows, points are followed from window to window: positions are NaN
    /// in `.npz`, null in `--json` and absent in CSV from where a point is lost on.
    #[arg(value_name = "FIELD")]
    field: PathBuf,
    /// Source image, by its global index.
    #[arg(long, value_name = "I")]
    image: usize,
    #[command(flatten)]
    which: Which,
    /// Target times: A..B (without B), or some, a comma between. [default: all]
    #[arg(long, value_name = "TIMES")]
    times: Option<String>,
    /// File to write: .npz or .csv. Without it CSV goes to standard output.
    #[arg(long, value_name = "FILE", value_parser = table_file)]
    out: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    /// One JSON object a line on standard output: path {image, pixel, times, positions, theta, confidence, moving} for each
    /// point (unless --out takes them), then done {points, times, file} or error.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Which pixels; in the processed picture, whose size the manifest and the field tell.
#[derive(Debug, Args)]
#[group(required = true, multiple = false)]
struct Which {
    /// Column and row of a pixel; may be given again.
    #[arg(long, value_name = "X,Y", value_parser = pixel)]
    pixel: Vec<[u32; 2]>,
    /// Text file with a pixel `X,Y` a line.
    #[arg(long, value_name = "FILE")]
    pixels: Option<PathBuf>,
    /// Picture of the processed size: pixels that are not black.
    #[arg(long, value_name = "PNG")]
    mask: Option<PathBuf>,
    /// Every N-th column and row; 1 for all pixels.
    #[arg(long, value_name = "N")]
    stride: Option<usize>,
}

fn pixel(text: &str) -> Result<[u32; 2], String> {
    let parts = text.split_once(',').and_then(|(x, y)| Some([x.trim().parse().ok()?, y.trim().parse().ok()?]));
    parts.ok_or_else(|| format!("`{text}` is no pixel: write column and row, such as 70,42"))
}

fn table_file(text: &str) -> Result<PathBuf, String> {
    let path = PathBuf::from(text);
    match path.extension().and_then(|e| e.to_str()) {
        Some("npz" | "csv") => Ok(path),
        _ => Err("its name must end in .npz or .csv".to_owned()),
    }
}

fn wrong(reason: String) -> CliError {
    OmnixError::Query { reason }.into()
}

/// Evaluates and prints.
pub(crate) fn run(args: &QueryArgs, ui: &mut Ui) -> Result<(), CliError> {
    let engine = args.device.open()?;
    let field = Saved::open(&engine, &args.field)?;
    let times = times(args.times.as_deref(), field.images().len())?;
    let [height, width] = field.size();
    let pixels = args.which.read(width, height)?;
    let (flat, positions) = field.paths(args.image, &pixels, &times)?;
    let known = field.pixel_values(args.image, &pixels)?;
    let when: Vec<ImageTime> = times
        .iter()
        .map(|t| &field.images()[*t])
        .map(|i| ImageTime { video: i.video, frame: i.frame, time_s: i.time_s })
        .collect();
    let list: Vec<[u32; 2]> = flat.iter().map(|p| [p % width as u32, p / width as u32]).collect();
    let theta = &known.theta;
    let moving: Vec<bool> = theta.iter().map(|t| field.moves(*t)).collect();
    let table = PathTable {
        image: args.image,
        times: &times,
        when: &when,
        pixels: &list,
        positions: &positions,
        confidence: &known.confidence,
        theta,
        moving: &moving,
        colours: known.colours.as_deref(),
    };
    show(args, &table, ui)
}

/// To the file, or as events or text.
fn show(args: &QueryArgs, table: &PathTable<'_>, ui: &mut Ui) -> Result<(), CliError> {
    if let Some(path) = &args.out {
        let npz = path.extension().is_some_and(|e| e == "npz");
        let written = if npz { table.write_npz(path)? } else { table.write_csv_file(path)? };
        ui.event("done", json!({ "points": table.pixels.len(), "times": table.times, "file": written }));
        ui.say(&format!("{} point(s) at {} time(s): {}", table.pixels.len(), table.times.len(), written.display()));
        return Ok(());
    }
    if ui.json() {
        let n = table.pixels.len();
        for (i, pixel) in table.pixels.iter().enumerate() {
            let place = |k: usize| -> &[f32] { &table.positions[3 * (k * n + i)..][..3] };
            let path: Vec<&[f32]> = (0..table.times.len()).map(place).collect();
            let (theta, confidence, moving) = (table.theta[i], table.confidence[i], table.moving[i]);
            ui.event(
                "path",
                json!({
                    "image": table.image, "pixel": pixel, "times": table.times, "positions": path, "theta": theta,
                    "confidence": confidence, "moving": moving,
                }),
            );
        }
        ui.event("done", json!({ "points": n, "times": table.times, "file": null }));
        return Ok(());
    }
    let mut text = Vec::new();
    table.write_csv(&mut text).map_err(CliError::Stdout)?;
    ui::print(&String::from_utf8_lossy(&text))
}

/// The target times of `--times`.
pub(crate) fn times(text: Option<&str>, images: usize) -> Result<Vec<usize>, CliError> {
    let Some(text) = text else { return Ok((0..images).collect()) };
    let bad = || wrong(format!("`{text}` are no times: write A..B (without B), or some such as 0,3,7"));
    let number = |part: &str| part.trim().parse::<usize>().map_err(|_| bad());
    let none = |time| wrong(format!("there is no time {time}: times go from 0 to {}", images.saturating_sub(1)));
    let times: Vec<usize> = match text.split_once("..") {
        Some((from, to)) => {
            let from = if from.trim().is_empty() { 0 } else { number(from)? };
            let to = if to.trim().is_empty() { images } else { number(to)? };
            // Before the range is collected: its end is whatever was typed.
            if to > images {
                return Err(none(to - 1));
            }
            (from..to).collect()
        }
        None => text.split(',').map(number).collect::<Result<_, _>>()?,
    };
    match times.iter().find(|t| **t >= images) {
        Some(time) => Err(none(*time)),
        None if times.is_empty() => Err(bad()),
        None => Ok(times),
    }
}

impl Which {
    fn read(&self, width: usize, height: usize) -> Result<Pixels, CliError> {
        if let Some(step) = self.stride {
            return Ok(Pixels::Stride(step));
        }
        if let Some(path) = &self.mask {
            let mask = load_picture(path)?;
            if (mask.width as usize, mask.height as usize) != (width, height) {
                return Err(wrong(format!(
                    "the mask {} has {}x{} pixels and the images of this field {width}x{height}: scale it to that size",
                    path.display(),
                    mask.width,
                    mask.height,
                )));
            }
            return Ok(Pixels::Mask(mask.data.as_chunks::<3>().0.iter().map(|c| c.iter().any(|v| *v > 0)).collect()));
        }
        let Some(path) = &self.pixels else { return Ok(Pixels::List(self.pixel.clone())) };
        let list = pixels_of(&read_list(path)?);
        Ok(Pixels::List(list.map_err(|e| wrong(format!("{}: {e}", path.display())))?))
    }
}

/// A pixel per line; empty lines and comments are passed over, as is the byte-order mark that some editors put in front.
fn pixels_of(text: &str) -> Result<Vec<[u32; 2]>, String> {
    let lines = text.strip_prefix('\u{feff}').unwrap_or(text).lines().map(str::trim);
    lines.filter(|line| !line.is_empty() && !line.starts_with('#')).map(pixel).collect()
}

/// Bytes of a list of pixels: more than all pixels of any image take.
const LONGEST_LIST: u64 = 256 << 20;

/// The text of `--pixels`; may come through a pipe.
fn read_list(path: &Path) -> Result<String, CliError> {
    let failed = |source| omnix::io::IoError::Read { path: path.to_owned(), source };
    let mut text = String::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(LONGEST_LIST + 1).read_to_string(&mut text).map_err(failed)?;
    if text.len() as u64 > LONGEST_LIST {
        let most = LONGEST_LIST >> 20;
        return Err(wrong(format!(
            "a list of more than {most} MiB: use --mask or --stride instead of {}",
            path.display()
        )));
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_ranges_or_lists() {
        assert_eq!(times(None, 5).unwrap(), [0, 1, 2, 3, 4]);
        assert_eq!(times(Some("1..3"), 5).unwrap(), [1, 2]);
        assert_eq!(times(Some("3.."), 5).unwrap(), [3, 4]);
        assert_eq!(times(Some("4, 0"), 5).unwrap(), [4, 0]);
        let huge = ["0..99999999999", "0..18446744073709551615", "4..18446744073709551615", "18446744073709551615"];
        for bad in ["5", "0..6", "2..2", "6..5", "7..8", "x", "1-3", ""].into_iter().chain(huge) {
            assert!(times(Some(bad), 5).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_list_may_begin_with_a_mark() {
        let text = "70,42\r\n# a comment\r\n\r\n 1, 2\r\n";
        assert_eq!(pixels_of(text), Ok(vec![[70, 42], [1, 2]]));
        assert_eq!(pixels_of(&format!("\u{feff}{text}")), pixels_of(text));
        assert!(pixels_of("1,2\n\u{feff}3,4").is_err());
    }

    #[test]
    fn pixels_are_two_numbers() {
        assert_eq!(pixel("70, 42"), Ok([70, 42]));
        assert!(pixel("70").is_err() && pixel("-1,2").is_err());
        assert!(table_file("a.npz").is_ok() && table_file("a.txt").is_err());
    }
}
