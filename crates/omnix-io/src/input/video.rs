//! What is known of a video before its pictures are read: its size upright with square pixels, the time of every frame, and
//! what of it is damaged or missing.
//!
//! ffprobe reads the header; one pass of ffmpeg over the whole video (`decoded.rs`) says which frames there are.

use std::{
    fmt, fs,
    io::{BufReader, Read, Seek},
    path::{Path, PathBuf},
    sync::mpsc::sync_channel,
};

use serde::Deserialize;

use super::{
    child::{self, PATIENCE, Running},
    container,
    decoded::{self, Decoded},
    ffmpeg::{self, Complaints, Tool},
    options::{ReadOptions, Stop},
};
use crate::IoError;

/// A video file's facts.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct VideoInfo {
    /// The file.
    pub path: PathBuf,
    /// Width in pixels, upright, of square pixels.
    pub width: u32,
    /// Height in pixels, upright, of square pixels.
    pub height: u32,
    /// Clockwise turn that the container asks for and ffmpeg applies, in whole degrees from 0 to 359.
    pub rotation: u32,
    /// Width of a stored pixel by its height; pictures are stretched where it is not 1.
    pub pixel_aspect: f64,
    /// Average frame rate as the container states it, frames a second; the times are the truth.
    pub frame_rate: Option<f64>,
    /// Presentation time of every decoded frame in seconds, ascending. The first need not be 0.
    pub times_s: Vec<f64>,
    /// Name of the codec.
    pub codec: String,
    /// What of it is damaged or missing.
    pub damage: Option<Damage>,
    /// What else a user should know.
    pub notes: Vec<String>,
    /// Whether ffmpeg counts frames from the start of the file to its end, and so can select them by number.
    pub(super) counted: bool,
}

/// What of a video is damaged or missing. What can be decoded is used all the same.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub struct Damage {
    /// Frames that could be decoded.
    pub decoded: usize,
    /// Frames that there should be, roughly; none if nothing says so.
    pub expected: Option<usize>,
    /// Decoded frames that the decoder says it had to patch up.
    pub patched: usize,
    /// How much of a file that was cut off is there.
    pub cut_off: Option<String>,
    /// The end of ffmpeg's complaints.
    pub words: Option<String>,
}

impl fmt::Display for Damage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.cut_off {
            Some(found) => write!(f, "cut off ({found})")?,
            None => f.write_str("damaged")?,
        }
        match self.expected.filter(|n| *n > self.decoded) {
            Some(all) => write!(f, ": {} of about {all} frames could be decoded", self.decoded)?,
            None => write!(f, ": {} frames could be decoded", self.decoded)?,
        }
        if self.patched > 0 {
            write!(f, ", {} of them only in part", self.patched)?;
        }
        self.words.as_ref().map_or(Ok(()), |words| write!(f, " ({words})"))
    }
}

#[derive(Deserialize)]
struct Probe {
    #[serde(default)]
    streams: Vec<Stream>,
    #[serde(default)]
    format: Format,
}

#[derive(Deserialize, Default)]
struct Format {
    duration: Option<String>,
}

#[derive(Deserialize)]
struct Stream {
    codec_name: Option<String>,
    avg_frame_rate: Option<String>,
    nb_frames: Option<String>,
    duration: Option<String>,
    #[serde(default)]
    tags: Tags,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(Deserialize, Default)]
struct Tags {
    rotate: Option<String>,
    #[serde(rename = "DURATION")]
    duration: Option<String>,
}

#[derive(Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

/// Reads the facts of a video file through ffprobe and ffmpeg. All of it is decoded once.
///
/// # Errors
/// ffprobe or ffmpeg missing or hung; a file they cannot read or that has no video stream; damage, where the options are
/// strict; a stop that was asked for.
pub fn probe_video(path: &Path, options: &ReadOptions) -> Result<VideoInfo, IoError> {
    let refuse = |reason: String| IoError::NotAVideo { reason, path: path.to_owned() };
    if fs::metadata(path).map_err(|e| IoError::read(path, e))?.len() == 0 {
        return Err(refuse("it is empty, 0 bytes".into()));
    }
    let stream = header(path, &options.stop)?;
    let cut_off = container::cut_off(path);
    let decoded = decoded::decode(path, options.choice.end_s(), &options.stop)?;
    if decoded.times.is_empty() {
        let detail = decoded.complaints.words();
        return Err(match cut_off {
            Some(found) => IoError::TruncatedVideo { detail: found, path: path.to_owned() },
            None if decoded.complaints.count == 0 => {
                IoError::NoFrames { found: "a video stream without frames".into(), path: path.to_owned() }
            }
            None => refuse(format!("no frame of it can be decoded: {detail}")),
        });
    }
    let damage = damage(&stream, &decoded, cut_off);
    if let Some(damage) = damage.as_ref().filter(|_| options.strict) {
        return Err(IoError::DamagedVideo { detail: damage.to_string(), path: path.to_owned() });
    }
    let frame_rate = stream.frame_rate();
    let (times_s, timeless) = times(&decoded.times, frame_rate);
    let mut notes = Vec::new();
    if timeless && decoded.times.len() > 1 {
        notes.push("its frames carry no ascending times: they follow from the frame rate".to_owned());
    }
    if let Some((number, (width, height))) = decoded.resized {
        let (w, h) = decoded.size;
        notes.push(format!("its pictures change from {w} x {h} to {width} x {height} pixels at frame {number}: all are brought to the first size"));
    }
    let (width, height) = square_pixels(decoded.size, decoded.pixel_aspect);
    Ok(VideoInfo {
        path: path.to_owned(),
        width,
        height,
        rotation: stream.rotation(),
        pixel_aspect: decoded.pixel_aspect,
        frame_rate,
        times_s,
        codec: stream.codec_name.unwrap_or_default(),
        damage,
        notes,
        counted: !decoded.recounted,
    })
}

/// What ffprobe says of the first video stream (cover pictures do not count).
fn header(path: &Path, stop: &Stop) -> Result<Stream, IoError> {
    /// Far more than the answer about one stream takes.
    const LONGEST: u64 = 1 << 20;
    let mut command = Tool::Ffprobe.command("error");
    command.args(["-select_streams", "V:0", "-of", "json", "-show_entries"]).arg(
        "stream=codec_name,avg_frame_rate,nb_frames,duration:stream_tags=rotate,DURATION:stream_side_data=rotation:format=duration",
    );
    Tool::Ffprobe.input(&mut command, path);
    let failed = |e| Tool::Ffprobe.start_error(path, e);
    let (mut running, pipes) = Running::start(command, stop, PATIENCE).map_err(failed)?;
    let (send, answer) = sync_channel(1);
    child::on_thread("ffprobe-answer", move || {
        let mut text = Vec::new();
        let _ = pipes.out.take(LONGEST).read_to_end(&mut text);
        let _ = send.send(text);
    })
    .map_err(failed)?;
    let (send, said) = sync_channel(1);
    child::on_thread("ffprobe-messages", move || {
        let mut complaints = Complaints::default();
        ffmpeg::each_line(BufReader::new(pipes.err), |line| {
            complaints.hear(&ffmpeg::message(line));
            true
        });
        let _ = send.send(complaints);
    })
    .map_err(failed)?;
    let gone = |e| child::gone(&e, "ffprobe", path);
    let answer = running.next(&answer).map_err(gone)?.unwrap_or_default();
    let complaints = running.next(&said).map_err(gone)?.unwrap_or_default();
    let refuse = |reason: String| IoError::NotAVideo { reason, path: path.to_owned() };
    if !running.succeeded().map_err(gone)? {
        let detail = complaints.words();
        let truncated = complaints.truncated && looks_like_video(path);
        return Err(if truncated { IoError::TruncatedVideo { detail, path: path.to_owned() } } else { refuse(detail) });
    }
    let probe: Probe =
        serde_json::from_slice(&answer).map_err(|e| refuse(format!("ffprobe's answer is not understood: {e}")))?;
    let mut stream = probe.streams.into_iter().next().ok_or_else(|| refuse("it has no video stream".into()))?;
    // Some containers state it for all streams together.
    if stream.tags.duration.is_none() {
        stream.duration = stream.duration.or(probe.format.duration);
    }
    Ok(stream)
}

impl Stream {
    fn frame_rate(&self) -> Option<f64> {
        self.avg_frame_rate.as_deref().and_then(ratio)
    }

    /// Frames that the header promises, by their number or by duration and rate.
    fn promised(&self) -> Option<usize> {
        let counted = self.nb_frames.as_deref().and_then(|n| n.parse().ok()).filter(|n| *n > 0);
        counted.or_else(|| {
            let stated = self.duration.as_deref().and_then(|d| d.parse::<f64>().ok());
            let seconds = stated.or_else(|| self.tags.duration.as_deref().and_then(clock))?;
            let frames = (seconds * self.frame_rate()?).round();
            (1.0..1e9).contains(&frames).then_some(frames as usize)
        })
    }

    /// Clockwise degrees. The display matrix states the turn counter-clockwise; the old tag states it clockwise.
    fn rotation(&self) -> u32 {
        let matrix = self.side_data_list.iter().find_map(|s| s.rotation).map(|r| -r);
        let tag = self.tags.rotate.as_deref().and_then(|r| r.parse::<f64>().ok());
        let degrees = matrix.or(tag).filter(|d| d.is_finite()).unwrap_or(0.0);
        (degrees.round() as i64).rem_euclid(360) as u32
    }
}

/// Whether anything is wrong with what was decoded. Errors that cost no frame are told of too: which picture they left their
/// mark in nobody knows.
fn damage(stream: &Stream, decoded: &Decoded, cut_off: Option<String>) -> Option<Damage> {
    let complaints = &decoded.complaints;
    if cut_off.is_none() && complaints.count == 0 && decoded.patched == 0 {
        return None;
    }
    Some(Damage {
        decoded: decoded.times.len(),
        expected: stream.promised().filter(|_| !decoded.ended_early),
        patched: decoded.patched,
        cut_off,
        words: (complaints.count > 0).then(|| complaints.words()),
    })
}

/// Times of all frames, and whether they had to be made from the frame rate because some are missing or go back (in some AVI
/// files, and where recordings were put together).
fn times(stated: &[Option<f64>], frame_rate: Option<f64>) -> (Vec<f64>, bool) {
    let ascending = stated.windows(2).all(|w| w[0] <= w[1]);
    match stated.iter().copied().collect::<Option<Vec<f64>>>().filter(|_| ascending) {
        Some(times) => (times, false),
        None => {
            let rate = frame_rate.unwrap_or(25.0);
            ((0..stated.len()).map(|i| i as f64 / rate).collect(), true)
        }
    }
}

/// The size with square pixels: the side that is too short grows, so that no detail is lost.
fn square_pixels((width, height): (u32, u32), aspect: f64) -> (u32, u32) {
    let grown = |side: u32, by: f64| (f64::from(side) * by).round() as u32;
    if aspect >= 1.0 { (grown(width, aspect), height) } else { (width, grown(height, 1.0 / aspect)) }
}

/// Tells a cut-off mp4 (its index was at the end) from a text file named .mp4.
fn looks_like_video(path: &Path) -> bool {
    let mut head = [0u8; 12];
    let read = fs::File::open(path).and_then(|mut f| f.rewind().and_then(|()| f.read(&mut head)));
    read.is_ok_and(|n| n >= 8) && matches!(&head[4..8], b"ftyp" | b"moov" | b"mdat" | b"wide" | b"free" | b"skip")
}

/// "30000/1001" to a number; none for "0/0".
fn ratio(text: &str) -> Option<f64> {
    let (a, b) = text.split_once('/')?;
    let value = a.parse::<f64>().ok()? / b.parse::<f64>().ok()?;
    (value.is_finite() && value > 0.0).then_some(value)
}

/// "00:01:02.500000000" to seconds.
fn clock(text: &str) -> Option<f64> {
    text.split(':').try_fold(0.0, |sum, part| part.parse::<f64>().ok().map(|n| 60.0 * sum + n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios_and_clocks() {
        assert_eq!(ratio("30000/1001"), Some(30000.0 / 1001.0));
        assert_eq!(ratio("0/0"), None);
        assert_eq!(ratio("25"), None);
        assert_eq!(clock("00:01:02.500000000"), Some(62.5));
        assert_eq!(clock("soon"), None);
    }

    #[test]
    fn times_without_stamps_follow_the_rate() {
        assert_eq!(times(&[Some(0.1), Some(0.2)], None), (vec![0.1, 0.2], false));
        assert_eq!(times(&[None, Some(0.1)], Some(10.0)), (vec![0.0, 0.1], true));
        assert_eq!(times(&[Some(5.0), Some(0.1)], None), (vec![0.0, 0.04], true), "times that go back");
    }

    #[test]
    fn pixels_become_square() {
        assert_eq!(square_pixels((160, 120), 2.0), (320, 120));
        assert_eq!(square_pixels((720, 576), 0.5), (720, 1152));
        assert_eq!(square_pixels((720, 576), 1.0), (720, 576));
    }

    #[test]
    fn turns_are_whole_degrees() {
        let turned = |r: f64| Stream {
            codec_name: None,
            avg_frame_rate: None,
            nb_frames: None,
            duration: None,
            tags: Tags::default(),
            side_data_list: vec![SideData { rotation: Some(r) }],
        };
        assert_eq!([-90.0, 90.0, 180.0, -60.0, f64::NAN].map(|r| turned(r).rotation()), [90, 270, 180, 60, 0]);
    }
}
