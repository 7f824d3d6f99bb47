//! `tum`: camera trajectories as the TUM RGB-D benchmark writes them, readable by evo.
//!
//! A line for each image: `timestamp tx ty tz qx qy qz qw`, camera-to-world, OpenCV axes. The timestamp is the presentation time
//! in seconds, or the frame number where the input has no times. One video: `trajectory.tum`; several: `trajectory_<video>.tum`,
//! all in the same world. `frame_times.csv` lists every image's video, frame and time.

use std::{
    collections::BTreeMap,
    fmt::Write,
    path::{Path, PathBuf},
};

use super::{
    atomic,
    camera::Camera,
    format::{Each, FileKind, Format, Points},
    frame::{FrameResult, RunSummary, Sink},
};
use crate::IoError;

const CONTAINS: &str = "timestamp tx ty tz qx qy qz qw of every image, camera-to-world";

pub(super) const FORMAT: Format = Format {
    name: "tum",
    needs_cameras: true,
    files: &[
        FileKind { name: "trajectory.tum", each: Each::OnlyVideo, contains: CONTAINS, points: Points::None },
        FileKind { name: "trajectory_{n}.tum", each: Each::Video, contains: CONTAINS, points: Points::None },
        FileKind::one("frame_times.csv", "video, frame and presentation time of every image"),
    ],
    disk: |size| size.images.saturating_mul(200),
    frames: Some(|dir, _| Ok(Box::new(TumSink::new(dir)))),
    ..Format::NONE
};

/// Keeps about 200 bytes per image.
struct TumSink {
    dir: PathBuf,
    videos: BTreeMap<u32, Video>,
    times: String,
}

#[derive(Default)]
struct Video {
    lines: String,
    untimed: bool,
}

impl TumSink {
    fn new(dir: &Path) -> Self {
        Self { dir: dir.to_owned(), videos: BTreeMap::new(), times: "index,video,frame,time_s\n".into() }
    }
}

impl Sink for TumSink {
    fn frame(&mut self, frame: &FrameResult<'_>) -> Result<(), IoError> {
        let (t, q) = Camera::of(frame, FORMAT.name)?.pose();
        let video = self.videos.entry(frame.video).or_default();
        let stamp = frame.time_s.unwrap_or_else(|| {
            video.untimed = true;
            f64::from(frame.frame)
        });
        let time = frame.time_s.map(|t| t.to_string()).unwrap_or_default();
        // Writing to a string cannot fail.
        let _ = writeln!(
            video.lines,
            "{stamp:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9} {:.9}",
            t.x, t.y, t.z, q.x, q.y, q.z, q.w
        );
        let _ = writeln!(self.times, "{},{},{},{time}", frame.index, frame.video, frame.frame);
        Ok(())
    }

    fn finish(self: Box<Self>, _summary: &RunSummary) -> Result<Vec<PathBuf>, IoError> {
        let several = self.videos.len() > 1;
        let mut written = Vec::new();
        for (number, video) in &self.videos {
            let name = if several { format!("trajectory_{number}.tum") } else { "trajectory.tum".into() };
            let stamp = if video.untimed { "frame number (the input has no times)" } else { "presentation time in s" };
            let text = format!(
                "# timestamp tx ty tz qx qy qz qw\n# camera-to-world, OpenCV axes; timestamp: {stamp}\n{}",
                video.lines
            );
            written.push(atomic::write_file(self.dir.join(name), text.as_bytes())?);
        }
        if !written.is_empty() {
            written.push(atomic::write_file(self.dir.join("frame_times.csv"), self.times.as_bytes())?);
        }
        Ok(written)
    }
}
