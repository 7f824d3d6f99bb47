//! ffmpeg and ffprobe as child processes: finding them, their arguments, their messages.
//!
//! `OMNIX_FFMPEG` and `OMNIX_FFPROBE` name other programs than those on the path.

use std::{
    env,
    ffi::OsString,
    io,
    path::Path,
    process::{Command, Stdio},
    sync::OnceLock,
};

use crate::IoError;

/// One of the two programs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Tool {
    Ffmpeg,
    Ffprobe,
}

impl Tool {
    fn name(self) -> &'static str {
        match self {
            Self::Ffmpeg => "ffmpeg",
            Self::Ffprobe => "ffprobe",
        }
    }

    /// A command with nothing on its input, so that ffmpeg never reads the terminal's keys.
    pub(super) fn command(self) -> Command {
        let variable = match self {
            Self::Ffmpeg => "OMNIX_FFMPEG",
            Self::Ffprobe => "OMNIX_FFPROBE",
        };
        let mut command = Command::new(env::var_os(variable).unwrap_or_else(|| self.name().into()));
        command.stdin(Stdio::null());
        command
    }

    /// Names the failure to start it.
    pub(super) fn start_error(self, path: &Path, source: io::Error) -> IoError {
        match source.kind() {
            io::ErrorKind::NotFound => IoError::MissingTool { tool: self.name(), path: path.to_owned() },
            _ => IoError::read(path, source),
        }
    }
}

/// The file as ffmpeg's URL: without the prefix a name with a colon would be taken for a protocol.
pub(super) fn file_url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// The option that hands every decoded frame on as it is, neither doubled nor dropped. `-fps_mode` came with ffmpeg 5.1 and
/// replaces `-vsync`.
pub(super) fn passthrough_option() -> &'static str {
    static OPTION: OnceLock<&str> = OnceLock::new();
    OPTION.get_or_init(|| {
        let output = Tool::Ffmpeg.command().arg("-version").output();
        let text = output.map(|o| String::from_utf8_lossy(&o.stdout).into_owned()).unwrap_or_default();
        let version = text.strip_prefix("ffmpeg version ").unwrap_or_default();
        let mut numbers = version
            .trim_start_matches('n')
            .split(|c: char| !c.is_ascii_digit())
            .map_while(|part| part.parse::<u32>().ok());
        // Builds from a repository carry no number ("N-12345-g..."): they are newer.
        match (numbers.next(), numbers.next()) {
            (Some(major), minor) if (major, minor.unwrap_or(0)) < (5, 1) => "-vsync",
            _ => "-fps_mode",
        }
    })
}

/// The last lines of a program's messages, without blank ones, on one line.
pub(super) fn last_words(stderr: &str) -> String {
    let lines: Vec<&str> = stderr.lines().map(str::trim).filter(|l| !l.is_empty()).collect();
    let tail = lines[lines.len().saturating_sub(3)..].join("; ");
    if tail.is_empty() { "it gave no reason".into() } else { tail }
}

/// Whether the messages speak of a file that ends too early.
pub(super) fn speaks_of_truncation(stderr: &str) -> bool {
    let text = stderr.to_ascii_lowercase();
    ["partial file", "ended prematurely", "truncat", "moov atom not found", "end of file"]
        .iter()
        .any(|words| text.contains(words))
}
