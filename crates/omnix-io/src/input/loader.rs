//! Decoding the planned frames.
//!
//! Pictures are read at random. A video is decoded by one ffmpeg child from its start; frames come through a pipe as binary
//! PPM (a text header with the size, then raw rgb24), so that the size is the decoder's word and not our guess at rotation.
//! Going on in order costs nothing extra; going back starts the child again.

use std::{
    fs::File,
    io::{self, BufRead, BufReader, Read, Seek, SeekFrom},
    path::PathBuf,
    process::{Child, ChildStdout, Stdio},
};

use super::{InputPlan, Picture, SourceKind, VideoInfo, ffmpeg, ffmpeg::Tool, load_picture};
use crate::IoError;

/// Up to this many chosen frames ffmpeg picks them itself and converts no others; beyond it, an expression that long would cost
/// more than the conversion.
const SELECT_AT_MOST: usize = 256;

/// Decodes the frames of a plan, one at a time.
#[derive(Debug)]
pub struct FrameLoader<'a> {
    plan: &'a InputPlan,
    /// The open video, if any, with its index: the ones before it are done.
    open: Option<(u32, VideoReader)>,
}

impl<'a> FrameLoader<'a> {
    /// A loader; nothing is opened yet.
    #[must_use]
    pub fn new(plan: &'a InputPlan) -> Self {
        Self { plan, open: None }
    }

    /// Decodes frame `index` of the plan. In ascending order every video is decoded once.
    ///
    /// # Errors
    /// Whatever [`load_picture`] says of a picture; a video that stops before the frame; ffmpeg missing.
    ///
    /// # Panics
    /// When the plan has no frame `index`: a fault of the caller.
    pub fn load(&mut self, index: usize) -> Result<Picture, IoError> {
        let frame = &self.plan.frames[index];
        let SourceKind::Video(info) = &self.plan.sources[frame.video as usize].kind else {
            return load_picture(&frame.path);
        };
        let mut reader = match self.open.take() {
            Some((video, reader)) if video == frame.video && reader.next <= frame.source_frame => reader,
            _ => {
                let wanted =
                    self.plan.frames.iter().filter(|f| f.video == frame.video && f.source_frame >= frame.source_frame);
                VideoReader::open(info, wanted.map(|f| f.source_frame).collect())?
            }
        };
        let picture = reader.frame(frame.source_frame)?;
        if self.plan.frames.get(index + 1).is_some_and(|next| next.video == frame.video) {
            self.open = Some((frame.video, reader));
        }
        Ok(picture)
    }
}

/// One ffmpeg child and what it will hand out.
#[derive(Debug)]
struct VideoReader {
    path: PathBuf,
    child: Child,
    out: BufReader<ChildStdout>,
    stderr: File,
    /// Frame numbers in the file that come through the pipe, ascending; none when all do.
    selected: Option<Vec<u32>>,
    /// How many came through.
    received: u32,
    /// Lowest frame number still to come.
    next: u32,
}

impl VideoReader {
    fn open(info: &VideoInfo, wanted: Vec<u32>) -> Result<Self, IoError> {
        let path = &info.path;
        let all = wanted.len() == info.times_s.len();
        let selected = (!all && wanted.len() <= SELECT_AT_MOST).then_some(wanted);
        // A file, not a pipe: a child with much to say would block on a pipe that nobody empties.
        let stderr = tempfile::tempfile().map_err(|e| IoError::write(std::env::temp_dir(), e))?;
        let child_stderr = stderr.try_clone().map_err(|e| IoError::write(std::env::temp_dir(), e))?;
        let mut command = Tool::Ffmpeg.command();
        command.args(["-nostdin", "-hide_banner", "-v", "error", "-i"]).arg(ffmpeg::file_url(path));
        command.args(["-map", "0:V:0"]);
        if let Some(numbers) = &selected {
            let terms: Vec<String> = numbers.iter().map(|n| format!("eq(n,{n})")).collect();
            command.arg("-vf").arg(format!("select='{}'", terms.join("+")));
            command.arg("-frames:v").arg(numbers.len().to_string());
        }
        command.args([ffmpeg::passthrough_option(), "passthrough"]);
        command.args(["-pix_fmt", "rgb24", "-c:v", "ppm", "-f", "image2pipe", "-"]);
        let mut child = command
            .stdout(Stdio::piped())
            .stderr(Stdio::from(child_stderr))
            .spawn()
            .map_err(|e| Tool::Ffmpeg.start_error(path, e))?;
        let Some(out) = child.stdout.take() else { unreachable!("BUG: stdout was asked for") };
        let out = BufReader::with_capacity(1 << 20, out);
        let next = selected.as_ref().and_then(|s| s.first().copied()).unwrap_or(0);
        Ok(Self { path: path.clone(), child, out, stderr, selected, received: 0, next })
    }

    /// Reads on up to frame `number` of the file.
    fn frame(&mut self, number: u32) -> Result<Picture, IoError> {
        loop {
            let coming = match &self.selected {
                Some(numbers) => numbers.get(self.received as usize).copied().unwrap_or(u32::MAX),
                None => self.received,
            };
            let picture = read_ppm(&mut self.out).map_err(|e| self.failure(coming.min(number), &e))?;
            self.received += 1;
            self.next = coming.saturating_add(1);
            if coming >= number {
                return Ok(picture);
            }
        }
    }

    fn failure(&mut self, frame: u32, error: &io::Error) -> IoError {
        let path = self.path.clone();
        // The child may hang on a broken file; its messages so far are enough.
        let _ = self.child.kill();
        let _ = self.child.wait();
        let mut text = String::new();
        let _ = self.stderr.seek(SeekFrom::Start(0)).and_then(|_| self.stderr.read_to_string(&mut text));
        let ended = error.kind() == io::ErrorKind::UnexpectedEof;
        let words = ffmpeg::last_words(&text);
        if ended && (text.trim().is_empty() || ffmpeg::speaks_of_truncation(&text)) {
            return IoError::TruncatedVideo { detail: format!("it ends before frame {frame}: {words}"), path };
        }
        let detail = if ended { words } else { format!("{error}; {words}") };
        IoError::VideoDecode { frame, detail, path }
    }
}

impl Drop for VideoReader {
    fn drop(&mut self) {
        // Nothing is left to do about a child that is already gone.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// One binary PPM picture: "P6", width, height, 255, one white space, then the bytes.
fn read_ppm(input: &mut impl BufRead) -> io::Result<Picture> {
    let mut fields = [0u32; 3];
    let mut magic = [0u8; 2];
    input.read_exact(&mut magic)?;
    let bad = || io::Error::new(io::ErrorKind::InvalidData, "ffmpeg's picture header is not understood");
    if magic != *b"P6" {
        return Err(bad());
    }
    for field in &mut fields {
        let mut byte = [0u8];
        input.read_exact(&mut byte)?;
        while byte[0].is_ascii_whitespace() {
            input.read_exact(&mut byte)?;
        }
        while byte[0].is_ascii_digit() {
            *field = field.checked_mul(10).and_then(|f| f.checked_add(u32::from(byte[0] - b'0'))).ok_or_else(bad)?;
            input.read_exact(&mut byte)?;
        }
    }
    let [width, height, depth] = fields;
    if width == 0 || height == 0 || width > 1 << 16 || height > 1 << 16 || depth != 255 {
        return Err(bad());
    }
    let mut data = vec![0; width as usize * height as usize * 3];
    input.read_exact(&mut data)?;
    Ok(Picture::new(width, height, data))
}
