//! Films (H.264 in MP4, by ffmpeg) and pictures (PNG) of finished pixels. Each has its name when it is whole.

use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};

use image::ExtendedColorType;

use super::atomic::{self, AtomicFile};
use super::depth;
use crate::IoError;
use crate::input::ffmpeg_program;

/// A film in the making: ffmpeg, and the file it writes to. Dropped before [`Film::finish`], it leaves nothing.
#[derive(Debug)]
pub struct Film {
    child: Child,
    input: Option<ChildStdin>,
    file: Option<AtomicFile>,
    path: PathBuf,
}

fn failed(path: &Path, reason: &str) -> IoError {
    IoError::Film { reason: reason.to_owned(), path: path.to_owned() }
}

impl Film {
    /// Whether there is an encoder: asked before the first picture is made.
    ///
    /// # Errors
    /// [`IoError::Film`] if ffmpeg cannot be started.
    pub fn check(path: &Path) -> Result<(), IoError> {
        let mut command = Command::new(ffmpeg_program());
        let asked = command.arg("-version").stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null()).status();
        asked.map(drop).map_err(|e| failed(path, &format!("ffmpeg cannot be started: {e}")))
    }

    /// Begins a film of pictures of `[width, height]`, `rate` a second. The encoder wants even sides: an odd last column or row is left out.
    ///
    /// # Errors
    /// [`IoError::Film`], and failures of making the file.
    pub fn begin(path: &Path, [width, height]: [u32; 2], rate: f64) -> Result<Self, IoError> {
        let file = AtomicFile::create(path.to_owned())?;
        let mut command = Command::new(ffmpeg_program());
        command.args(["-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s"]);
        command.arg(format!("{width}x{height}")).arg("-r").arg(rate.to_string()).args(["-i", "-", "-an"]);
        command.args(["-vf", "crop=trunc(iw/2)*2:trunc(ih/2)*2", "-c:v", "libx264", "-pix_fmt", "yuv420p"]);
        command
            .args(["-crf", "18", "-preset", "veryfast", "-movflags", "+faststart", "-f", "mp4"])
            .arg(file.temporary());
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|e| failed(path, &format!("ffmpeg cannot be started: {e}")))?;
        let input = child.stdin.take();
        Ok(Self { child, input, file: Some(file), path: path.to_owned() })
    }

    /// Adds a picture: `[height][width][3]`.
    ///
    /// # Errors
    /// [`IoError::Film`] in the encoder's words, if it has ended.
    pub fn picture(&mut self, rgb: &[u8]) -> Result<(), IoError> {
        let Some(input) = &mut self.input else { return Ok(()) };
        match input.write_all(rgb) {
            Ok(()) => Ok(()),
            // Why an encoder ended early is in its own words.
            Err(error) => Err(self
                .ended()
                .unwrap_or_else(|| failed(&self.path, &format!("ffmpeg takes no more pictures: {error}")))),
        }
    }

    /// Completes the film.
    ///
    /// # Errors
    /// [`IoError::Film`], and failures of writing.
    pub fn finish(mut self) -> Result<PathBuf, IoError> {
        match (self.ended(), self.file.take()) {
            (None, Some(file)) => file.commit(),
            (Some(error), _) => Err(error),
            (None, None) => Err(failed(&self.path, "BUG: it was finished twice")),
        }
    }

    /// Ends the input and waits for the encoder; what went wrong, if something did.
    fn ended(&mut self) -> Option<IoError> {
        use std::io::Read as _;

        drop(self.input.take());
        let mut words = String::new();
        if let Some(mut stderr) = self.child.stderr.take() {
            // Words that are no Unicode are lost; that it failed, its status says.
            let _ = stderr.read_to_string(&mut words);
        }
        match self.child.wait() {
            Ok(status) if status.success() => None,
            Ok(_) => Some(failed(&self.path, words.lines().next().unwrap_or("ffmpeg failed without a word"))),
            Err(error) => Some(failed(&self.path, &format!("ffmpeg cannot be waited for: {error}"))),
        }
    }
}

impl Drop for Film {
    fn drop(&mut self) {
        // One that has ended cannot be ended again, which is no failure.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Writes a PNG of 8-bit pixels, `[height][width][3]`, or `[height][width][4]` with cover.
///
/// # Errors
/// Failures of encoding and writing.
pub fn write_png(path: PathBuf, pixels: &[u8], [width, height]: [u32; 2], cover: bool) -> Result<PathBuf, IoError> {
    let kind = if cover { ExtendedColorType::Rgba8 } else { ExtendedColorType::Rgb8 };
    let bytes = depth::encode(&path, pixels, (width, height), kind)?;
    atomic::write_file(path, &bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn films_are_whole_or_absent() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("new/film.mp4");
        let mut film = Film::begin(&path, [33, 18], 12.0).unwrap();
        (0..5u8).for_each(|k| film.picture(&vec![40 * k; 33 * 18 * 3]).unwrap());
        assert_eq!(film.finish().unwrap(), path);
        let bytes = std::fs::read(&path).unwrap();
        assert!(bytes.len() > 500 && &bytes[4..8] == b"ftyp");
        let mut left = Film::begin(&dir.path().join("new/left.mp4"), [32, 18], 12.0).unwrap();
        left.picture(&[0; 32 * 18 * 3]).unwrap();
        drop(left);
        assert_eq!(std::fs::read_dir(dir.path().join("new")).unwrap().count(), 1);
    }

    #[test]
    fn an_encoder_that_refuses_is_quoted() {
        let dir = tempfile::tempdir().unwrap();
        // Pictures of no pixels.
        let film = Film::begin(&dir.path().join("film.mp4"), [0, 0], 12.0).unwrap();
        let error = film.finish().unwrap_err();
        assert!(matches!(&error, IoError::Film { reason, .. } if !reason.is_empty()), "{error}");
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn pictures_are_read_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = write_png(dir.path().join("a.png"), &[1, 2, 3, 4, 5, 6, 7, 8], [2, 1], true).unwrap();
        assert_eq!(image::open(path).unwrap().into_rgba8().into_raw(), [1, 2, 3, 4, 5, 6, 7, 8]);
    }
}
