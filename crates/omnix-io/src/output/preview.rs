//! `preview`: what a run looks like, for people: `preview.mp4`, every picture beside its depth, and `poster.png`, up to four pictures above
//! theirs.
//!
//! Depth has one range of colours for the whole run, the 2nd to the 98th percentile of inverse depth over all images (near is red, far violet, no
//! depth black), so that a colour means the same in every image. The range is known at the end: pictures and depth wait in an unnamed file. The
//! film is encoded by ffmpeg (H.264); one image a frame, at the rate of the input where it has times.

use std::fs::File;
use std::io::{BufReader, Read as _, Seek as _, SeekFrom};
use std::path::{Path, PathBuf};

use image::imageops::{self, FilterType};
use image::{ExtendedColorType, RgbImage};

use super::atomic::{self, Spool};
use super::colour;
use super::depth;
use super::film::Film;
use super::format::{Each, FileKind, Format, Points};
use super::frame::{FrameResult, RunSummary, Sink};
use super::options::SinkOptions;
use super::sample::{Reservoir, percentile};
use crate::IoError;

const FILM: &str = "preview.mp4";
const POSTER: &str = "poster.png";

pub(super) const FORMAT: Format = Format {
    name: "preview",
    files: &[
        FileKind {
            name: FILM,
            each: Each::Run,
            contains: "every picture beside its depth, one range of colours for all",
            points: Points::None,
        },
        FileKind {
            name: POSTER,
            each: Each::Run,
            contains: "up to four pictures above their depth",
            points: Points::None,
        },
    ],
    // What waits, and a film and a poster of enlarged pictures.
    disk: |size| {
        size.all().saturating_mul(10).saturating_add(size.images.saturating_mul(100_000)).saturating_add(1 << 20)
    },
    memory: |size| size.pixels.saturating_mul(60).saturating_add(SAMPLE as u64 * 40),
    frames: Some(|dir, options| Ok(Box::new(PreviewSink::new(dir, options)?))),
    ..Format::NONE
};

/// Depths that the range is found from.
const SAMPLE: usize = 1 << 17;
/// Pictures are enlarged by whole factors to at least this width.
const WIDTH: u32 = 400;
/// Frames a second where the input has no times.
const RATE: f64 = 6.0;
/// Pictures of a poster.
const SHOWN: usize = 4;

struct PreviewSink {
    dir: PathBuf,
    waiting: Spool,
    sample: Reservoir<f32>,
    size: (u32, u32),
    images: usize,
    /// Presentation times of the first video.
    times: Vec<f64>,
}

impl PreviewSink {
    fn new(dir: &Path, options: &SinkOptions) -> Result<Self, IoError> {
        // Before anything is computed: whether there is an encoder.
        let path = dir.join(FILM);
        Film::check(&path)?;
        let waiting = Spool::new(dir, path)?;
        let sample = Reservoir::new(SAMPLE, options.seed);
        Ok(Self { dir: dir.to_owned(), waiting, sample, size: (0, 0), images: 0, times: Vec::new() })
    }
}

impl Sink for PreviewSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        frame.check(FORMAT.name)?;
        self.size = (frame.width, frame.height);
        for &depth in frame.depth.iter().filter(|d| d.is_finite() && **d > 0.0) {
            self.sample.offer(|| 1.0 / depth);
        }
        self.waiting.put(frame.rgb)?;
        self.waiting.put(bytemuck::cast_slice(frame.depth))?;
        self.images += 1;
        self.times.extend(frame.time_s.filter(|_| frame.video == 0));
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        let Self { dir, waiting, sample, size, images, times } = *self;
        if images == 0 {
            return Ok(Vec::new());
        }
        let mut sorted: Vec<f32> = sample.finish(SAMPLE, |v| v.is_finite());
        sorted.sort_unstable_by(f32::total_cmp);
        let range = [percentile(&sorted, 2.0).unwrap_or(0.0), percentile(&sorted, 98.0).unwrap_or(1.0)];
        let mut pictures = Waiting { file: waiting.into_reader()?, size, range, path: dir.join(FILM) };
        let film = encode(&mut pictures, images, rate(&times))?;
        let poster = poster(&mut pictures, images, &dir.join(POSTER))?;
        Ok(vec![film, poster])
    }
}

/// Images a second: of the times that a video's images have, or a rate at which pictures can be looked at.
fn rate(times: &[f64]) -> f64 {
    match times {
        [first, .., last] if last > first => ((times.len() - 1) as f64 / (last - first)).clamp(1.0, 60.0),
        _ => RATE,
    }
}

/// Pictures and depth that wait for the range of colours.
struct Waiting {
    file: BufReader<File>,
    size: (u32, u32),
    range: [f32; 2],
    path: PathBuf,
}

impl Waiting {
    /// The picture of image `index` and its depth in colours, enlarged.
    fn pair(&mut self, index: usize) -> Result<[RgbImage; 2], IoError> {
        let (width, height) = self.size;
        let pixels = width as usize * height as usize;
        let (mut rgb, mut depth) = (vec![0; 3 * pixels], vec![0f32; pixels]);
        let at = SeekFrom::Start((7 * pixels * index) as u64);
        let read = self.file.seek(at).and_then(|_| self.file.read_exact(&mut rgb));
        let read = read.and_then(|()| self.file.read_exact(bytemuck::cast_slice_mut(&mut depth)));
        read.map_err(|e| IoError::read(&self.path, e))?;
        let colours = colour::colour_inverse(&depth, self.range);
        let factor = WIDTH.div_ceil(width).max(1);
        let enlarged = |data: Vec<u8>, filter| {
            let image =
                RgbImage::from_raw(width, height, data).unwrap_or_else(|| unreachable!("BUG: lengths were checked"));
            imageops::resize(&image, width * factor, height * factor, filter)
        };
        Ok([enlarged(rgb, FilterType::Triangle), enlarged(colours, FilterType::Triangle)])
    }
}

/// Encodes the film.
fn encode(pictures: &mut Waiting, images: usize, rate: f64) -> Result<PathBuf, IoError> {
    let [first, _] = pictures.pair(0)?;
    let mut film = Film::begin(&pictures.path, [2 * first.width(), first.height()], rate)?;
    for index in 0..images {
        let [picture, depth] = pictures.pair(index)?;
        let rows = picture.rows().zip(depth.rows());
        let bytes: Vec<u8> = rows.flat_map(|(a, b)| a.chain(b).flat_map(|pixel| pixel.0)).collect();
        film.picture(&bytes)?;
    }
    film.finish()
}

/// Pictures above their depth, evenly spread over the run.
fn poster(pictures: &mut Waiting, images: usize, path: &Path) -> Result<PathBuf, IoError> {
    let shown = images.min(SHOWN);
    let mut sheet: Option<RgbImage> = None;
    for k in 0..shown {
        let [picture, depth] = pictures.pair(k * (images - 1) / (shown - 1).max(1))?;
        let (width, height) = picture.dimensions();
        let sheet = sheet.get_or_insert_with(|| RgbImage::new(width * shown as u32, 2 * height));
        let left = i64::from(width) * k as i64;
        imageops::replace(sheet, &picture, left, 0);
        imageops::replace(sheet, &depth, left, i64::from(height));
    }
    let sheet = sheet.unwrap_or_default();
    atomic::write_file(path.to_owned(), &depth::encode(path, &sheet, sheet.dimensions(), ExtendedColorType::Rgb8)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::export::{Export, open_sinks};

    fn run(dir: &Path, images: usize, size: (u32, u32)) -> Vec<PathBuf> {
        let pixels = (size.0 * size.1) as usize;
        let mut sink = open_sinks(&[Export::Preview], dir, &SinkOptions::default()).unwrap().remove(0);
        for index in 0..images {
            let frame = FrameResult {
                index,
                video: 0,
                frame: index as u32,
                time_s: Some(0.5 * index as f64),
                width: size.0,
                height: size.1,
                // Left half near in every image; the right half goes away.
                depth: &(0..pixels)
                    .map(|p| if p % (size.0 as usize) < size.0 as usize / 2 { 1.0 } else { 2.0 + index as f32 })
                    .collect::<Vec<_>>(),
                confidence: None,
                rgb: &vec![40 * index as u8; 3 * pixels],
                extrinsics: None,
                intrinsics: None,
                sky: None,
                gaussians: None,
                features: &[],
                source: None,
            };
            sink.frame(&frame).unwrap();
        }
        sink.finish(&RunSummary::default()).unwrap()
    }

    #[test]
    fn a_film_and_a_poster_with_one_range_of_colours() {
        for (images, size) in [(5, (84, 56)), (1, (14, 14)), (2, (434, 28))] {
            let dir = tempfile::tempdir().unwrap();
            let written = run(dir.path(), images, size);
            assert_eq!(written, [dir.path().join(FILM), dir.path().join(POSTER)]);
            assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
            let film = std::fs::read(&written[0]).unwrap();
            assert!(film.len() > 500 && &film[4..8] == b"ftyp");
            let poster = image::open(&written[1]).unwrap().into_rgb8();
            let factor = WIDTH.div_ceil(size.0);
            let shown = images.min(SHOWN) as u32;
            assert_eq!(poster.dimensions(), (size.0 * factor * shown, 2 * size.1 * factor));
            // What is as near in the first and in the last image has one colour.
            let below = 2 * size.1 * factor - 2;
            assert_eq!(poster.get_pixel(2, below), poster.get_pixel(2 + size.0 * factor * (shown - 1), below));
        }
        let nothing = tempfile::tempdir().unwrap();
        assert_eq!(run(nothing.path(), 0, (14, 14)), Vec::<PathBuf>::new());
    }

    #[test]
    fn rates_are_those_of_the_input() {
        assert_eq!((rate(&[]), rate(&[1.0]), rate(&[2.0, 2.0])), (RATE, RATE, RATE));
        assert_eq!(rate(&[0.0, 0.1, 0.2]), 10.0);
        assert_eq!((rate(&[0.0, 1e-9]), rate(&[0.0, 100.0])), (60.0, 1.0));
    }
}
