//! What ffprobe says of a video: its size after rotation and the presentation time of every frame.
//!
//! Packets are read, not decoded: an hour of video takes about a second. Times are the packets' presentation times in
//! ascending order, which is the order ffmpeg hands frames out in.

use std::{
    fs::File,
    io::Read,
    path::{Path, PathBuf},
};

use serde::Deserialize;

use super::ffmpeg::{self, Tool};
use crate::IoError;

/// A video file's facts.
#[derive(Debug, Clone, PartialEq)]
pub struct VideoInfo {
    /// The file.
    pub path: PathBuf,
    /// Width in pixels after rotation.
    pub width: u32,
    /// Height in pixels after rotation.
    pub height: u32,
    /// Clockwise rotation that the container asks for and ffmpeg applies, in degrees (0, 90, 180, 270).
    pub rotation: u32,
    /// Average frame rate as the container states it, frames a second; the times are the truth.
    pub frame_rate: Option<f64>,
    /// Presentation time of every frame in seconds, ascending. The first need not be 0.
    pub times_s: Vec<f64>,
    /// Name of the codec.
    pub codec: String,
}

#[derive(Deserialize)]
struct Probe {
    #[serde(default)]
    packets: Vec<Packet>,
    #[serde(default)]
    streams: Vec<Stream>,
    #[serde(default)]
    format: Format,
}

#[derive(Deserialize, Default)]
struct Format {
    #[serde(default)]
    format_name: String,
}

#[derive(Deserialize)]
struct Packet {
    pts_time: Option<String>,
    dts_time: Option<String>,
    #[serde(default)]
    flags: String,
}

#[derive(Deserialize)]
struct Stream {
    codec_name: Option<String>,
    width: Option<u32>,
    height: Option<u32>,
    avg_frame_rate: Option<String>,
    nb_frames: Option<String>,
    #[serde(default)]
    tags: Tags,
    #[serde(default)]
    side_data_list: Vec<SideData>,
}

#[derive(Deserialize, Default)]
struct Tags {
    rotate: Option<String>,
}

#[derive(Deserialize)]
struct SideData {
    rotation: Option<f64>,
}

/// Reads the facts of a video file through ffprobe.
///
/// # Errors
/// ffprobe missing; a file it cannot read; a file without a video stream; a video that ends before its index does.
pub fn probe_video(path: &Path) -> Result<VideoInfo, IoError> {
    let output = Tool::Ffprobe
        .command()
        .args(["-v", "error", "-select_streams", "V:0", "-of", "json", "-show_entries"])
        .arg(
            "stream=codec_name,width,height,avg_frame_rate,nb_frames:stream_tags=rotate:stream_side_data=rotation:\
             packet=pts_time,dts_time,flags:format=format_name",
        )
        .arg(ffmpeg::file_url(path))
        .output()
        .map_err(|e| Tool::Ffprobe.start_error(path, e))?;
    let stderr = String::from_utf8_lossy(&output.stderr);
    let refuse = |reason: String| IoError::NotAVideo { reason, path: path.to_owned() };
    if !output.status.success() {
        let detail = ffmpeg::last_words(&stderr);
        let truncated = ffmpeg::speaks_of_truncation(&stderr) && looks_like_video(path);
        return Err(if truncated { IoError::TruncatedVideo { detail, path: path.to_owned() } } else { refuse(detail) });
    }
    let probe: Probe = serde_json::from_slice(&output.stdout)
        .map_err(|e| refuse(format!("ffprobe's answer is not understood: {e}")))?;
    let stream = probe.streams.first().ok_or_else(|| refuse("it has no video stream".into()))?;
    let (Some(width), Some(height)) = (stream.width, stream.height) else {
        return Err(refuse("its video stream has no size".into()));
    };
    if width == 0 || height == 0 {
        return Err(refuse(format!("its video stream is {width} x {height}")));
    }
    let frame_rate = stream.avg_frame_rate.as_deref().and_then(ratio);
    let found = probe.packets.len();
    // Only the mp4 family's index is a promise; AVI counts empty chunks too.
    let indexed = probe.format.format_name.contains("mp4");
    let promised = stream.nb_frames.as_deref().and_then(|n| n.parse::<usize>().ok());
    if let Some(promised) = promised.filter(|&promised| indexed && promised > found) {
        let detail = format!("{found} of {promised} frames are there");
        return Err(IoError::TruncatedVideo { detail, path: path.to_owned() });
    }
    if let Some(detail) = riff_cut_off(path) {
        return Err(IoError::TruncatedVideo { detail, path: path.to_owned() });
    }
    if ffmpeg::speaks_of_truncation(&stderr) {
        return Err(IoError::TruncatedVideo { detail: ffmpeg::last_words(&stderr), path: path.to_owned() });
    }
    let times_s = frame_times(&probe.packets, frame_rate);
    if times_s.is_empty() {
        return Err(IoError::NoFrames { found: "a video stream without frames".into(), path: path.to_owned() });
    }
    let rotation = rotation(stream);
    let (width, height) = if rotation % 180 == 90 { (height, width) } else { (width, height) };
    let codec = stream.codec_name.clone().unwrap_or_default();
    Ok(VideoInfo { path: path.to_owned(), width, height, rotation, frame_rate, times_s, codec })
}

/// AVI files state their own length; ffmpeg plays a shorter file without a word.
fn riff_cut_off(path: &Path) -> Option<String> {
    let mut head = [0u8; 12];
    let mut file = File::open(path).ok()?;
    file.read_exact(&mut head).ok()?;
    let stated = u64::from(u32::from_le_bytes([head[4], head[5], head[6], head[7]])) + 8;
    let found = file.metadata().ok()?.len();
    // Programs that never went back to fill the length in leave 0 or all ones.
    let filled = (9..u64::from(u32::MAX)).contains(&stated);
    let avi = head.starts_with(b"RIFF") && head.ends_with(b"AVI ");
    (avi && filled && found < stated).then(|| format!("{found} of {stated} bytes are there"))
}

/// Tells a cut-off mp4 (its index was at the end) from a text file named .mp4.
fn looks_like_video(path: &Path) -> bool {
    let mut head = [0u8; 12];
    let read = File::open(path).and_then(|mut f| f.read(&mut head));
    read.is_ok_and(|n| n >= 8) && matches!(&head[4..8], b"ftyp" | b"moov" | b"mdat" | b"wide" | b"free" | b"skip")
}

/// Ascending presentation times. Packets marked to be discarded (before an edit list's start) decode to nothing. Where a
/// container has no times (some AVI files), they follow from the frame rate.
fn frame_times(packets: &[Packet], frame_rate: Option<f64>) -> Vec<f64> {
    let seconds = |text: &Option<String>| text.as_deref().and_then(|t| t.parse::<f64>().ok()).filter(|t| t.is_finite());
    let shown = packets.iter().filter(|p| !p.flags.contains('D'));
    let mut times = Vec::with_capacity(packets.len());
    let mut complete = true;
    for packet in shown {
        let time = seconds(&packet.pts_time).or_else(|| seconds(&packet.dts_time));
        complete &= time.is_some();
        times.push(time.unwrap_or(0.0));
    }
    if complete {
        times.sort_by(f64::total_cmp);
    } else {
        let rate = frame_rate.unwrap_or(25.0);
        times = (0..times.len()).map(|i| i as f64 / rate).collect();
    }
    times
}

/// Clockwise degrees. The display matrix states the turn counter-clockwise; the old tag states it clockwise.
fn rotation(stream: &Stream) -> u32 {
    let matrix = stream.side_data_list.iter().find_map(|s| s.rotation).map(|r| -r);
    let tag = stream.tags.rotate.as_deref().and_then(|r| r.parse::<f64>().ok());
    let degrees = matrix.or(tag).unwrap_or(0.0);
    ((degrees / 90.0).round() as i64).rem_euclid(4) as u32 * 90
}

/// "30000/1001" to a number; none for "0/0".
fn ratio(text: &str) -> Option<f64> {
    let (a, b) = text.split_once('/')?;
    let value = a.parse::<f64>().ok()? / b.parse::<f64>().ok()?;
    (value.is_finite() && value > 0.0).then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ratios() {
        assert_eq!(ratio("30000/1001"), Some(30000.0 / 1001.0));
        assert_eq!(ratio("0/0"), None);
        assert_eq!(ratio("25"), None);
    }

    #[test]
    fn times_without_stamps_follow_the_rate() {
        let packet =
            |t: Option<&str>, flags: &str| Packet { pts_time: t.map(Into::into), dts_time: None, flags: flags.into() };
        let packets = [packet(Some("0.2"), "K_"), packet(Some("0.1"), "__"), packet(Some("0.0"), "_D")];
        assert_eq!(frame_times(&packets, None), [0.1, 0.2]);
        let packets = [packet(None, "K_"), packet(Some("0.1"), "__")];
        assert_eq!(frame_times(&packets, Some(10.0)), [0.0, 0.1]);
    }
}
