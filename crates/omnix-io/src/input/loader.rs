//! Decoding the planned frames.
//!
//! Pictures are read at random. A video is decoded by one ffmpeg child from its start; frames come through a pipe as binary
//! PPM (a text header with the size, then raw rgb24), so that the size is the decoder's word, which is compared with the plan's.
//! Going on in order costs nothing extra; going back starts the child again.

use std::{
    io::{self, BufRead, BufReader},
    path::PathBuf,
    sync::{Arc, Mutex, PoisonError, mpsc::Receiver, mpsc::sync_channel},
};

use super::{
    child::{self, PATIENCE, Running},
    ffmpeg::{self, Complaints, Tool},
    options::Stop,
    picture::{Picture, load_within},
    plan::{InputPlan, SourceKind},
    video::VideoInfo,
};
use crate::IoError;

/// Up to this many chosen frames ffmpeg picks them itself and converts no others; beyond it, an expression that long would cost
/// more than the conversion.
const SELECT_AT_MOST: usize = 256;

/// Decodes the frames of a plan, one at a time.
#[derive(Debug)]
pub struct FrameLoader<'a> {
    plan: &'a InputPlan,
    stop: Stop,
    /// The open video, if any, with its index: the ones before it are done.
    open: Option<(u32, VideoReader)>,
}

impl<'a> FrameLoader<'a> {
    /// A loader; nothing is opened yet.
    #[must_use]
    pub fn new(plan: &'a InputPlan) -> Self {
        Self { plan, stop: Stop::default(), open: None }
    }

    /// Asks `stop` while it waits for ffmpeg.
    #[must_use]
    pub fn stop(mut self, stop: Stop) -> Self {
        self.stop = stop;
        self
    }

    /// Decodes frame `index` of the plan. In ascending order every video is decoded once.
    ///
    /// # Errors
    /// Whatever [`super::load_picture`] says of a picture; a frame whose size is not the planned one; a video that stops before
    /// the frame; ffmpeg missing or hung; a stop that was asked for.
    ///
    /// # Panics
    /// When the plan has no frame `index`: a fault of the caller.
    pub fn load(&mut self, index: usize) -> Result<Picture, IoError> {
        self.stop.check()?;
        let frame = &self.plan.frames[index];
        let SourceKind::Video(info) = &self.plan.sources[frame.video as usize].kind else {
            let picture = load_within(&frame.path, frame.bytes)?;
            if (picture.width, picture.height) != (frame.width, frame.height) {
                return Err(IoError::Changed { path: frame.path.clone() });
            }
            return Ok(picture);
        };
        let mut reader = match self.open.take() {
            Some((video, reader)) if video == frame.video && reader.next <= frame.source_frame => reader,
            _ => {
                let wanted =
                    self.plan.frames.iter().filter(|f| f.video == frame.video && f.source_frame >= frame.source_frame);
                VideoReader::open(info, wanted.map(|f| f.source_frame).collect(), &self.stop)?
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
    running: Running,
    pictures: Receiver<io::Result<Picture>>,
    complaints: Arc<Mutex<Complaints>>,
    /// Width and height of every picture.
    size: (u32, u32),
    /// Frame numbers in the file that come through the pipe, ascending; none when all do.
    selected: Option<Vec<u32>>,
    /// How many came through.
    received: u32,
    /// Lowest frame number still to come.
    next: u32,
}

impl VideoReader {
    fn open(info: &VideoInfo, wanted: Vec<u32>, stop: &Stop) -> Result<Self, IoError> {
        let path = &info.path;
        let all = wanted.len() == info.times_s.len();
        let selected = (!all && info.counted && wanted.len() <= SELECT_AT_MOST).then_some(wanted);
        let mut filters = Vec::new();
        if let Some(numbers) = &selected {
            let terms: Vec<String> = numbers.iter().map(|n| format!("eq(n,{n})")).collect();
            filters.push(format!("select='{}'", terms.join("+")));
        }
        if info.pixel_aspect != 1.0 {
            filters.push(format!("scale={}:{},setsar=1", info.width, info.height));
        }
        let mut command = Tool::Ffmpeg.command("error");
        // Progress on its messages is a sign of life where the next chosen frame is far away.
        command.args(["-progress", "pipe:2", "-nostats"]);
        Tool::Ffmpeg.input(&mut command, path);
        command.args(["-map", "0:V:0"]);
        if !filters.is_empty() {
            command.arg("-vf").arg(filters.join(","));
        }
        if let Some(numbers) = &selected {
            command.arg("-frames:v").arg(numbers.len().to_string());
        }
        command.args([ffmpeg::passthrough_option(stop), "passthrough"]);
        command.args(["-pix_fmt", "rgb24", "-c:v", "ppm", "-f", "image2pipe", "-"]);
        let failed = |e| Tool::Ffmpeg.start_error(path, e);
        let (running, pipes) = Running::start(command, stop, PATIENCE).map_err(failed)?;
        // No picture waits in the channel: one is being taken while the next is being read.
        let (send, pictures) = sync_channel(0);
        let size = (info.width, info.height);
        child::on_thread("ffmpeg-pictures", move || {
            let mut out = BufReader::with_capacity(1 << 20, pipes.out);
            loop {
                let picture = read_ppm(&mut out, size);
                let last = picture.is_err();
                if send.send(picture).is_err() || last {
                    return;
                }
            }
        })
        .map_err(failed)?;
        let complaints = Arc::<Mutex<Complaints>>::default();
        let heard = complaints.clone();
        child::on_thread("ffmpeg-messages", move || {
            ffmpeg::each_line(BufReader::new(pipes.err), |line| {
                heard.lock().unwrap_or_else(PoisonError::into_inner).hear(&ffmpeg::message(line));
                true
            });
        })
        .map_err(failed)?;
        let next = selected.as_ref().and_then(|s| s.first().copied()).unwrap_or(0);
        Ok(Self { path: path.clone(), running, pictures, complaints, size, selected, received: 0, next })
    }

    /// Reads on up to frame `number` of the file.
    fn frame(&mut self, number: u32) -> Result<Picture, IoError> {
        loop {
            let coming = match &self.selected {
                Some(numbers) => numbers.get(self.received as usize).copied().unwrap_or(u32::MAX),
                None => self.received,
            };
            let picture = match self.running.next(&self.pictures) {
                Ok(Some(Ok(picture))) => picture,
                Ok(Some(Err(error))) => return Err(self.failure(coming.min(number), &error)),
                Ok(None) => return Err(self.failure(coming.min(number), &io::ErrorKind::UnexpectedEof.into())),
                Err(gone) => return Err(child::gone(&gone, "ffmpeg", &self.path)),
            };
            self.received += 1;
            self.next = coming.saturating_add(1);
            if coming >= number {
                return Ok(picture);
            }
        }
    }

    fn failure(&mut self, frame: u32, error: &io::Error) -> IoError {
        // The child may hang on a broken file; its messages so far are enough.
        self.running.kill();
        let complaints = self.complaints.lock().unwrap_or_else(PoisonError::into_inner);
        let (width, height) = self.size;
        let detail = match error.kind() {
            io::ErrorKind::UnexpectedEof => format!("it ends before: {}", complaints.words()),
            io::ErrorKind::InvalidData => format!("{error}, {width} x {height} was expected"),
            _ => format!("{error}; {}", complaints.words()),
        };
        IoError::VideoDecode { frame, detail, path: self.path.clone() }
    }
}

/// One binary PPM picture of this size: "P6", width, height, 255, one white space, then the bytes.
fn read_ppm(input: &mut impl BufRead, size: (u32, u32)) -> io::Result<Picture> {
    let mut fields = [0u32; 3];
    let mut magic = [0u8; 2];
    input.read_exact(&mut magic)?;
    let bad = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
    let unclear = || bad("ffmpeg's picture header is not understood".to_owned());
    if magic != *b"P6" {
        return Err(unclear());
    }
    for field in &mut fields {
        let mut byte = [0u8];
        input.read_exact(&mut byte)?;
        while byte[0].is_ascii_whitespace() {
            input.read_exact(&mut byte)?;
        }
        while byte[0].is_ascii_digit() {
            *field =
                field.checked_mul(10).and_then(|f| f.checked_add(u32::from(byte[0] - b'0'))).ok_or_else(unclear)?;
            input.read_exact(&mut byte)?;
        }
    }
    let [width, height, depth] = fields;
    if depth != 255 {
        return Err(unclear());
    }
    // Nothing is allocated by numbers that the plan does not know.
    if (width, height) != size {
        return Err(bad(format!("a picture of {width} x {height} pixels")));
    }
    let mut data = vec![0; width as usize * height as usize * 3];
    input.read_exact(&mut data)?;
    Ok(Picture::new(width, height, data))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pictures_of_another_size_are_refused_before_they_are_read() {
        let mut one: &[u8] = b"P6\n2 1\n255\nabcdef";
        assert_eq!(read_ppm(&mut one, (2, 1)).unwrap(), Picture::new(2, 1, b"abcdef".to_vec()));
        for (bytes, size) in [
            (&b"P6\n2 1\n255\nabcdef"[..], (1, 2)),
            (b"P6\n4000000000 4000000000\n255\n", (2, 1)),
            (b"P6\n99999999999 1\n255\n", (2, 1)),
            (b"P5\n2 1\n255\nab", (2, 1)),
        ] {
            let error = read_ppm(&mut &bytes[..], size).unwrap_err();
            assert_eq!(error.kind(), io::ErrorKind::InvalidData, "{error}");
        }
        assert_eq!(read_ppm(&mut &b"P6\n2 1\n255\nabc"[..], (2, 1)).unwrap_err().kind(), io::ErrorKind::UnexpectedEof);
    }
}
