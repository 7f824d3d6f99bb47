//! ffmpeg and ffprobe as child processes: finding them, what they may open, their messages.
//!
//! `OMNIX_FFMPEG` and `OMNIX_FFPROBE` name other programs than those on the path. Both may open the named file and no other,
//! and only as one of a list of containers: a text file named .mp4 could be a playlist, which opens files, or goes on for ever.

use std::{
    env,
    ffi::OsString,
    io::{self, BufRead, BufReader, Read},
    path::Path,
    process::Command,
    sync::{OnceLock, mpsc::sync_channel},
    time::Duration,
};

use super::{
    child::{self, Running},
    options::Stop,
};
use crate::IoError;

/// Containers that are read, by ffmpeg's names: none of them refers to other files. The content decides which it is, not the
/// file's name, so those are here too that have an extension of their own.
const CONTAINERS: &str = "mov,mp4,m4a,3gp,3g2,mj2,matroska,webm,avi,flv,asf,mpegts,mpeg,ogg,gif";
/// Level of each message in front of it, and no summing up of equal ones.
const LEVELS: &str = "repeat+level+";

/// One of the two programs.
#[derive(Debug, Clone, Copy)]
pub(super) enum Tool {
    Ffmpeg,
    Ffprobe,
}

impl Tool {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ffmpeg => "ffmpeg",
            Self::Ffprobe => "ffprobe",
        }
    }

    fn program(self) -> OsString {
        let variable = match self {
            Self::Ffmpeg => "OMNIX_FFMPEG",
            Self::Ffprobe => "OMNIX_FFPROBE",
        };
        env::var_os(variable).unwrap_or_else(|| self.name().into())
    }

    /// A command that says what is wrong from `level` on. Its input comes next, by [`Tool::input`].
    pub(super) fn command(self, level: &str) -> Command {
        let mut command = Command::new(self.program());
        if matches!(self, Self::Ffmpeg) {
            command.arg("-nostdin");
        }
        command.args(["-hide_banner", "-v"]).arg(format!("{LEVELS}{level}"));
        command.args(["-protocol_whitelist", "file", "-format_whitelist", CONTAINERS]);
        command
    }

    /// Names the input.
    pub(super) fn input(self, command: &mut Command, path: &Path) {
        if matches!(self, Self::Ffmpeg) {
            command.arg("-i");
        }
        command.arg(file_url(path));
    }

    /// Names the failure to start it.
    pub(super) fn start_error(self, path: &Path, source: io::Error) -> IoError {
        match source.kind() {
            io::ErrorKind::NotFound => IoError::MissingTool { tool: self.name(), path: path.to_owned() },
            _ => IoError::ToolStart { tool: self.name(), path: path.to_owned(), source },
        }
    }
}

/// The program that also encodes films.
pub(crate) fn ffmpeg_program() -> OsString {
    Tool::Ffmpeg.program()
}

/// The file as ffmpeg's URL: without the prefix a name with a colon would be taken for a protocol.
fn file_url(path: &Path) -> OsString {
    let mut url = OsString::from("file:");
    url.push(path);
    url
}

/// The version of ffmpeg, major and minor. Builds from a repository carry no number ("N-12345-g..."): they are newer than any.
pub(super) fn version(stop: &Stop) -> (u32, u32) {
    static VERSION: OnceLock<(u32, u32)> = OnceLock::new();
    *VERSION.get_or_init(|| {
        let text = first_line(stop).unwrap_or_default();
        let version = text.strip_prefix("ffmpeg version ").unwrap_or_default();
        let mut numbers = version
            .trim_start_matches('n')
            .split(|c: char| !c.is_ascii_digit())
            .map_while(|part| part.parse::<u32>().ok());
        numbers.next().map_or((u32::MAX, 0), |major| (major, numbers.next().unwrap_or(0)))
    })
}

/// What `ffmpeg -version` begins with; none if it says nothing. Why will show when it is asked to decode.
fn first_line(stop: &Stop) -> Option<String> {
    /// Saying its version takes milliseconds.
    const PATIENCE: Duration = Duration::from_secs(10);
    let mut command = Command::new(Tool::Ffmpeg.program());
    command.arg("-version");
    let (mut running, pipes) = Running::start(command, stop, PATIENCE).ok()?;
    let (send, lines) = sync_channel(1);
    let read = move || each_line(BufReader::new(pipes.out), |line| send.send(line.to_owned()).is_ok());
    child::on_thread("ffmpeg-version", read).ok()?;
    running.next(&lines).ok()?
}

/// The option that hands every decoded frame on as it is, neither doubled nor dropped. `-fps_mode` came with ffmpeg 5.1 and
/// replaces `-vsync`.
pub(super) fn passthrough_option(stop: &Stop) -> &'static str {
    if version(stop) < (5, 1) { "-vsync" } else { "-fps_mode" }
}

/// Calls `hear` with every line, cut to a bounded length, until it says no or the pipe closes.
pub(super) fn each_line(mut input: impl BufRead, mut hear: impl FnMut(&str) -> bool) {
    const LONGEST: u64 = 4096;
    loop {
        let mut line = Vec::new();
        match input.by_ref().take(LONGEST).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        if line.last() != Some(&b'\n') && input.skip_until(b'\n').is_err() {
            return;
        }
        if !hear(&String::from_utf8_lossy(&line)) {
            return;
        }
    }
}

/// How grave a message is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Level {
    /// Something went wrong.
    Error,
    Warning,
    /// Everything else, progress too.
    Info,
}

/// One line of messages: who says it, how grave it is, what.
#[derive(Debug, PartialEq)]
pub(super) struct Message<'a> {
    pub(super) from: &'a str,
    pub(super) level: Level,
    pub(super) text: &'a str,
}

/// Takes `[h264 @ 0x5581] [error] words` apart.
pub(super) fn message(line: &str) -> Message<'_> {
    let (mut from, mut level, mut text) = ("", Level::Info, line.trim());
    while let Some((inside, rest)) = text.strip_prefix('[').and_then(|t| t.split_once("] ")) {
        let known = match inside {
            "error" | "fatal" | "panic" => Some(Level::Error),
            "warning" => Some(Level::Warning),
            "info" | "verbose" | "debug" => Some(Level::Info),
            _ => None,
        };
        text = rest.trim();
        if let Some(known) = known {
            level = known;
            break;
        }
        from = inside.split(" @ ").next().unwrap_or(inside);
    }
    Message { from, level, text }
}

/// What was said of errors: how many, and the last of them, short.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub(super) struct Complaints {
    pub(super) count: usize,
    last: Vec<String>,
    /// Whether one speaks of a file that ends too early.
    pub(super) truncated: bool,
}

impl Complaints {
    /// Kept lines, and characters of each: a damaged file can fill a disk with messages.
    const LINES: usize = 3;
    const LONGEST: usize = 200;

    pub(super) fn hear(&mut self, message: &Message<'_>) {
        if message.level != Level::Error || message.text.is_empty() {
            return;
        }
        self.count += 1;
        self.truncated |= speaks_of_truncation(message.text);
        let from = if message.from.is_empty() { String::new() } else { format!("{}: ", message.from) };
        // The words may quote the file: nothing of it reaches a terminal as a control character.
        let printable = |c: char| if c.is_control() { '\u{fffd}' } else { c };
        let line: String = format!("{from}{}", message.text).chars().map(printable).take(Self::LONGEST).collect();
        if self.last.contains(&line) {
            return;
        }
        if self.last.len() == Self::LINES {
            self.last.remove(0);
        }
        self.last.push(line);
    }

    /// The last messages on one line.
    pub(super) fn words(&self) -> String {
        if self.last.is_empty() { "it gave no reason".into() } else { self.last.join("; ") }
    }
}

/// Whether a message speaks of a file that ends too early.
fn speaks_of_truncation(text: &str) -> bool {
    let text = text.to_ascii_lowercase();
    ["partial file", "ended prematurely", "truncat", "moov atom not found", "end of file"]
        .iter()
        .any(|words| text.contains(words))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_are_taken_apart() {
        let of = |from, level, text| Message { from, level, text };
        assert_eq!(message("[h264 @ 0x5f] [error] Reference 4 >= 3"), of("h264", Level::Error, "Reference 4 >= 3"));
        assert_eq!(
            message("[warning] a.mp4: corrupt decoded frame"),
            of("", Level::Warning, "a.mp4: corrupt decoded frame")
        );
        let two = message("[swscaler @ 0x1] [swscaler @ 0x2] [warning] deprecated");
        assert_eq!(two, of("swscaler", Level::Warning, "deprecated"));
        assert_eq!(message("frame=12"), of("", Level::Info, "frame=12"));
        assert_eq!(message("[unfinished"), of("", Level::Info, "[unfinished"));
    }

    #[test]
    fn complaints_are_few_and_short() {
        let mut complaints = Complaints::default();
        for n in 0..1000 {
            complaints.hear(&message(&format!("[x @ 0x1] [error] {n} \u{1b}[31m{}", "long ".repeat(1000))));
        }
        complaints.hear(&message("[info] File ended prematurely"));
        assert_eq!((complaints.count, complaints.truncated), (1000, false));
        let words = complaints.words();
        assert!(words.len() < 700 && words.contains("999") && !words.contains('\u{1b}'), "{words}");
        complaints.hear(&message("[error] File ended prematurely"));
        assert!(complaints.truncated);
    }
}
