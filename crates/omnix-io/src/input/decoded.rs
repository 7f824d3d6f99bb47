//! The frames of a video as ffmpeg decodes them: their number, times, size and pixel shape.
//!
//! One pass over the whole video, without conversion or output. Nothing less is the truth: packets may decode to no frame
//! (VP8's hidden ones), frames may be dropped at cuts, headers may be wrong about the size. ffmpeg's filter `showinfo` says a
//! line about each frame, after the turn that the container asks for; the pass that delivers pictures decodes with the
//! same options, so its n-th frame is the n-th one here.

use std::{io::BufReader, path::Path, sync::mpsc::sync_channel};

use super::{
    child::{self, PATIENCE, Running},
    ffmpeg::{self, Complaints, Level, Tool},
    options::Stop,
};
use crate::IoError;

/// What the pass found.
#[derive(Debug, Default)]
pub(super) struct Decoded {
    /// Time of every frame in its stream, where it has one.
    pub(super) times: Vec<Option<f64>>,
    /// Width and height of the first frame, upright, in coded pixels.
    pub(super) size: (u32, u32),
    /// Width of a pixel by its height; 1 where the file says nothing sensible.
    pub(super) pixel_aspect: f64,
    /// Number and size of the first frame whose size is another.
    pub(super) resized: Option<(usize, (u32, u32))>,
    /// Whether ffmpeg began its count of frames anew, as it does when their form changes: then it cannot select by number.
    pub(super) recounted: bool,
    /// Frames that the decoder says it had to patch up.
    pub(super) patched: usize,
    /// What ffmpeg objected to.
    pub(super) complaints: Complaints,
    /// Whether the pass ended before the video did, because later frames are not wanted.
    pub(super) ended_early: bool,
}

/// Decodes the first video stream up to `until` seconds after its first frame.
pub(super) fn decode(path: &Path, until: Option<f64>, stop: &Stop) -> Result<Decoded, IoError> {
    let mut command = Tool::Ffmpeg.command("info");
    Tool::Ffmpeg.input(&mut command, path);
    // Sums over all pixels, which nobody reads; the option came with ffmpeg 4.3.
    let filter = if ffmpeg::version(stop) < (4, 3) { "showinfo" } else { "showinfo=checksum=0" };
    command.args(["-map", "0:V:0", "-vf", filter, ffmpeg::passthrough_option(stop), "passthrough"]);
    command.args(["-nostats", "-f", "null", "-"]);
    let failed = |e| Tool::Ffmpeg.start_error(path, e);
    let (mut running, pipes) = Running::start(command, stop, PATIENCE).map_err(failed)?;
    let (send, lines) = sync_channel(1024);
    let err = pipes.err;
    let pass_on = move || ffmpeg::each_line(BufReader::new(err), |line| send.send(line.to_owned()).is_ok());
    child::on_thread("ffmpeg-frames", pass_on).map_err(failed)?;
    let mut decoded = Decoded { pixel_aspect: 1.0, ..Decoded::default() };
    while let Some(line) = running.next(&lines).map_err(|e| child::gone(&e, "ffmpeg", path))? {
        decoded.hear(&line);
        if decoded.is_past(until) {
            decoded.ended_early = true;
            decoded.times.pop();
            break;
        }
    }
    Ok(decoded)
}

impl Decoded {
    fn hear(&mut self, line: &str) {
        let message = ffmpeg::message(line);
        match message.level {
            Level::Error => self.complaints.hear(&message),
            Level::Warning => self.patched += usize::from(message.text.contains("corrupt decoded frame")),
            Level::Info if message.from.starts_with("Parsed_showinfo") => {
                if let Some(frame) = shown(message.text) {
                    self.add(&frame);
                }
            }
            Level::Info => {}
        }
    }

    fn add(&mut self, frame: &Shown) {
        let number = self.times.len();
        if number == 0 {
            self.size = frame.size;
            self.pixel_aspect = frame.aspect;
        } else if frame.size != self.size && self.resized.is_none() {
            self.resized = Some((number, frame.size));
        }
        self.recounted |= frame.number != number;
        self.times.push(frame.time);
    }

    /// Whether the last frame comes after `until`.
    fn is_past(&self, until: Option<f64>) -> bool {
        match (until, self.times.first(), self.times.last()) {
            (Some(until), Some(Some(first)), Some(Some(last))) => last - first > until,
            _ => false,
        }
    }
}

/// One frame, as `showinfo` states it.
#[derive(Debug, PartialEq)]
struct Shown {
    number: usize,
    time: Option<f64>,
    aspect: f64,
    size: (u32, u32),
}

/// Reads `n:   4 pts:      4 pts_time:0.4     ... sar:1/1 s:64x48 ...`; none for other lines.
fn shown(text: &str) -> Option<Shown> {
    let text = text.strip_prefix("n:")?;
    let value = |name: &str| {
        let at = text.find(name)? + name.len();
        text[at..].split_whitespace().next()
    };
    let (width, height) = value(" s:")?.split_once('x')?;
    let aspect = value(" sar:").and_then(|sar| {
        let (across, down) = sar.split_once('/')?;
        Some(across.parse::<f64>().ok()? / down.parse::<f64>().ok()?)
    });
    Some(Shown {
        number: text.split_whitespace().next()?.parse().ok()?,
        time: value(" pts_time:")?.parse().ok().filter(|t: &f64| t.is_finite()),
        // 0/1 is "not known"; beyond these bounds it is a mistake.
        aspect: aspect.filter(|a| (0.1..=10.0).contains(a)).unwrap_or(1.0),
        size: (width.parse().ok()?, height.parse().ok()?),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_several_versions() {
        let of = |number, time, aspect, size| Some(Shown { number, time, aspect, size });
        let five = "n:   4 pts:      4 pts_time:0.4     pos:    12222 fmt:yuvj420p sar:2/1 s:48x64 i:P iskey:1 type:I ";
        assert_eq!(shown(five), of(4, Some(0.4), 2.0, (48, 64)));
        let seven = "n:   0 pts:      0 pts_time:0       duration:   1024 duration_time:0.1     fmt:yuv420p cl:left sar:0/1 s:64x48 i:P iskey:1 type:I checksum:1 plane_checksum:[1] mean:[2] stdev:[0.0]";
        assert_eq!(shown(seven), of(0, Some(0.0), 1.0, (64, 48)));
        let none = "n:  10 pts:NOPTS pts_time:NOPTS pos:-1 fmt:gray sar:1/1 s:8x8 i:P";
        assert_eq!(shown(none), of(10, None, 1.0, (8, 8)));
        assert_eq!(shown("color_range:tv color_space:unknown"), None);
        assert_eq!(shown("config in time_base: 1/10, frame_rate: 10/1"), None);
    }

    #[test]
    fn counts_sizes_and_the_end() {
        let mut decoded = Decoded::default();
        let line = |n: usize, time: f64, size: &str| {
            format!("[Parsed_showinfo_0 @ 0x1] [info] n: {n} pts: 1 pts_time:{time} fmt:gray sar:1/1 s:{size} i:P")
        };
        decoded.hear(&line(0, 1.0, "64x48"));
        decoded.hear(&line(1, 1.5, "64x48"));
        assert!(!decoded.recounted && !decoded.is_past(Some(0.5)) && decoded.is_past(Some(0.4)));
        decoded.hear("[warning] a.mp4: corrupt decoded frame in stream 0");
        decoded.hear("    title: [Parsed_showinfo_0 @ 0x1] [info] n: 0 pts: 1 pts_time:9 fmt:gray sar:1/1 s:1x1 i:P");
        decoded.hear(&line(0, 2.0, "48x64"));
        assert!(decoded.recounted);
        assert_eq!((decoded.times.len(), decoded.patched, decoded.resized), (3, 1, Some((2, (48, 64)))));
    }
}
