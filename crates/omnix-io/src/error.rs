//! What can go wrong between files and the engine. Messages name the thing and the cure, the path last.

use std::{io, path::PathBuf};

/// Errors of reading inputs, preparing pictures and writing results.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum IoError {
    /// An input names nothing that exists and matches no file as a pattern.
    #[error("no such file, folder or matching pattern: check the spelling of {path}")]
    NotFound {
        /// The input as given.
        path: PathBuf,
    },
    /// Cameras that cannot be read, or do not fit the pictures.
    #[error("these cameras cannot be used: {reason}: {path}")]
    BadCameras {
        /// What is wrong, and the cure.
        reason: String,
        /// The file or folder.
        path: PathBuf,
    },
    /// Masks that cannot be read, or do not fit the pictures.
    #[error("these masks cannot be used: {reason}: {path}")]
    BadMasks {
        /// What is wrong, and the cure.
        reason: String,
        /// The folder.
        path: PathBuf,
    },
    /// A glob pattern that cannot be parsed.
    #[error("not a valid file pattern ({reason}): {pattern}")]
    BadPattern {
        /// The pattern as given.
        pattern: String,
        /// What the parser objects to.
        reason: String,
    },
    /// A file whose extension is neither a picture's nor a video's.
    #[error(
        "files of type \"{extension}\" are not read: convert to png, jpg, webp or bmp (pictures) \
         or mp4, mov, avi, mkv, webm, m4v, flv, wmv or gif (videos): {path}"
    )]
    UnsupportedExtension {
        /// The extension, lower case, without the dot; empty if the name has no extension.
        extension: String,
        /// The file.
        path: PathBuf,
    },
    /// A pipe, a device or a socket where a file is needed.
    #[error(
        "not a plain file (a pipe, a device or a socket): copy what it gives into a file and name that instead of {path}"
    )]
    NotAPlainFile {
        /// The input.
        path: PathBuf,
    },
    /// A file named like a picture that holds something else.
    #[error("not a picture, found {found}: replace or remove {path}")]
    NotAnImage {
        /// What the first bytes look like.
        found: String,
        /// The file.
        path: PathBuf,
    },
    /// A picture whose file ends too early.
    #[error("the picture is cut off ({detail}): copy it again from its source: {path}")]
    TruncatedImage {
        /// What was missing.
        detail: String,
        /// The file.
        path: PathBuf,
    },
    /// A picture whose data is damaged in the middle.
    #[error("the picture is damaged ({reason}): copy it again from its source: {path}")]
    ImageDamaged {
        /// What was found.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A picture that takes more memory to decode than it may.
    #[error(
        "a picture of {width} x {height} pixels takes {} MiB to decode, and {} MiB may be used: make it smaller, or allow more memory: {path}",
        needed.div_ceil(1 << 20), most >> 20
    )]
    PictureTooLarge {
        /// Width in pixels as stored.
        width: u32,
        /// Height in pixels as stored.
        height: u32,
        /// Bytes that decoding takes at most.
        needed: u64,
        /// Bytes that it may take.
        most: u64,
        /// The file.
        path: PathBuf,
    },
    /// A file that is not any more what it was when the frames were listed.
    #[error("the file has changed since its frames were listed: leave the inputs alone while they are read: {path}")]
    Changed {
        /// The file.
        path: PathBuf,
    },
    /// A picture that the decoder refuses.
    #[error("cannot decode the picture ({reason}): convert it to an 8-bit png: {path}")]
    ImageDecode {
        /// The decoder's words.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// An input without a single frame.
    #[error("no frames, found {found}: name a folder with pictures, a picture or a video instead of {path}")]
    NoFrames {
        /// What was found instead.
        found: String,
        /// The input.
        path: PathBuf,
    },
    /// A choice of frames that chooses nothing.
    #[error("{reason}: ask for at least one frame and a positive, finite rate")]
    BadChoice {
        /// What was asked for.
        reason: String,
    },
    /// ffmpeg or ffprobe is not installed.
    #[error(
        "{tool} was not found, and videos are read through it: install ffmpeg (apt install ffmpeg) or pass a folder of pictures instead of {path}"
    )]
    MissingTool {
        /// Name of the program.
        tool: &'static str,
        /// The video that needed it.
        path: PathBuf,
    },
    /// ffmpeg or ffprobe cannot be started, though it is there.
    #[error(
        "cannot start {tool}: check that it can be executed and that more processes are allowed; it was needed for {path}"
    )]
    ToolStart {
        /// Name of the program.
        tool: &'static str,
        /// The video that needed it.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// ffmpeg does not encode a film.
    #[error("the film cannot be written ({reason}): install an ffmpeg with libx264, or do without the film: {path}")]
    Film {
        /// What it said.
        reason: String,
        /// The film.
        path: PathBuf,
    },
    /// ffmpeg or ffprobe runs and gives nothing.
    #[error(
        "{tool} gave nothing for {seconds} seconds and was ended: check the disk, or convert the video first: {path}"
    )]
    ToolHangs {
        /// Name of the program.
        tool: &'static str,
        /// How long it was waited for.
        seconds: u64,
        /// The video.
        path: PathBuf,
    },
    /// The caller asked to stop.
    #[error("interrupted while reading")]
    Interrupted,
    /// ffprobe cannot read the file as a video.
    #[error("not a readable video ({reason}): check that the file is complete, or convert it with ffmpeg: {path}")]
    NotAVideo {
        /// ffprobe's words.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A damaged video, where damage is refused.
    #[error(
        "the video is {detail}: copy it again from its source, or allow damaged videos to use what can be decoded: {path}"
    )]
    DamagedVideo {
        /// How much of it there is.
        detail: String,
        /// The file.
        path: PathBuf,
    },
    /// A video of which so much is missing that nothing can be decoded.
    #[error("the video is cut off ({detail}), and nothing of it can be decoded: copy it again from its source: {path}")]
    TruncatedVideo {
        /// How much is there, or ffmpeg's words.
        detail: String,
        /// The file.
        path: PathBuf,
    },
    /// ffmpeg stopped in the middle of a video.
    #[error("cannot decode frame {frame} of the video ({detail}): convert it with ffmpeg first: {path}")]
    VideoDecode {
        /// Frame number in the file, from 0.
        frame: u32,
        /// The end of ffmpeg's messages.
        detail: String,
        /// The file.
        path: PathBuf,
    },
    /// A picture that preprocessing would reduce to nothing or blow up without bound.
    #[error("a picture of {width} x {height} pixels becomes {becomes}: {cure}")]
    DegenerateSize {
        /// Input width in pixels.
        width: u32,
        /// Input height in pixels.
        height: u32,
        /// What preprocessing would make of it.
        becomes: String,
        /// What to do.
        cure: String,
    },
    /// A name that is not one of a fixed list.
    #[error("unknown {what} \"{name}\": use one of {known}")]
    UnknownName {
        /// What the name should have been.
        what: &'static str,
        /// The name as given.
        name: String,
        /// The known names.
        known: &'static str,
    },
    /// An export needs something that the network did not give.
    #[error(
        "the export {export} needs {missing}, which image {index} does not have: leave {export} out or use a network with cameras"
    )]
    MissingField {
        /// Name of the export.
        export: &'static str,
        /// What is missing.
        missing: &'static str,
        /// Global index of the image.
        index: usize,
    },
    /// A result whose buffers do not have the size they claim, or differ from the first image's where one array holds all.
    #[error("image {index} has {what} of {found} values where the export {export} needs {expected}")]
    WrongSize {
        /// Name of the export.
        export: &'static str,
        /// Which buffer.
        what: &'static str,
        /// Global index of the image.
        index: usize,
        /// Needed number of values.
        expected: usize,
        /// Number of values found.
        found: usize,
    },
    /// A point that is not a pixel of one of the images.
    #[error("point {point} cannot be exported as {export}: {reason}; choose pixels inside the processed pictures")]
    BadPoint {
        /// Name of the export.
        export: &'static str,
        /// Index of the point.
        point: usize,
        /// What is wrong with it.
        reason: &'static str,
    },
    /// Nothing to export.
    #[error(
        "the export {export} has no points: none of those offered is finite at every time; leave {export} out or choose other points"
    )]
    NoPoints {
        /// Name of the export.
        export: &'static str,
    },
    /// A file that is not a saved field.
    #[error("not a saved field ({reason}): name the field.safetensors of a run instead of {path}")]
    NotAField {
        /// What was found instead.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A saved field of another version.
    #[error(
        "a saved field of version {found}, and this program reads version {known}: save it again with this program: {path}"
    )]
    FieldVersion {
        /// The version in the file.
        found: String,
        /// The version that is read.
        known: &'static str,
        /// The file.
        path: PathBuf,
    },
    /// A saved field whose file ends too early.
    #[error("the saved field is cut short, {found} bytes of {expected}: copy it again or save it again: {path}")]
    FieldCutShort {
        /// Bytes that the header promises.
        expected: u64,
        /// Bytes that are there.
        found: u64,
        /// The file.
        path: PathBuf,
    },
    /// A tensor of a saved field that is absent or not as expected or not as announced.
    #[error("tensor \"{name}\" of the saved field {reason}: save the field again: {path}")]
    FieldTensor {
        /// Name of the tensor.
        name: String,
        /// What is wrong with it.
        reason: String,
        /// The file.
        path: PathBuf,
    },
    /// A number of a field that is finite, and would be infinite as f16.
    #[error("{name}[{index}] = {value} of the field does not fit in f16; save the field as f32: {path}")]
    FieldDoesNotFit {
        /// Name of the tensor.
        name: String,
        /// Index of the element, row by row.
        index: usize,
        /// What it is.
        value: f64,
        /// The file.
        path: PathBuf,
    },
    /// Another run writes to the output folder.
    #[error("another run is writing to this folder: wait until it ends, or choose another folder: {path}")]
    FolderInUse {
        /// The folder.
        path: PathBuf,
    },
    /// A file that was written, or the folder that it is written in, is gone before the run has ended.
    #[error("gone while the run went on: something removed it or its folder, so run again: {path}")]
    Vanished {
        /// The file.
        path: PathBuf,
    },
    /// The output folder cannot be made or written to.
    #[error("cannot write to the output folder: choose another or change its permissions: {path}")]
    OutputFolder {
        /// The folder.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// No space left.
    #[error("the disk is full: free some space or choose another folder; while writing {path}")]
    DiskFull {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// No space left where temporary files go.
    #[error("no space left for temporary files: free some space there, or name another folder in TMPDIR: {path}")]
    TemporaryFull {
        /// The system's folder for temporary files.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// A file above the size that the system allows this process (`ulimit -f`).
    #[error(
        "the file grew above the size that this process may write (ulimit -f): raise the limit, or write less; while writing {path}"
    )]
    FileTooLarge {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Any other failure of reading.
    #[error("cannot read: check that the file exists and is readable: {path}")]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Any other failure of writing.
    #[error("cannot write: check the folder's permissions and the disk: {path}")]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
}

impl IoError {
    /// Wraps a failed write: a full disk, an exceeded quota, a file above the size allowed and a folder that is gone get
    /// names of their own.
    pub fn write(path: impl Into<PathBuf>, source: io::Error) -> Self {
        let path = path.into();
        match source.kind() {
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded if path == std::env::temp_dir() => {
                Self::TemporaryFull { path, source }
            }
            io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => Self::DiskFull { path, source },
            io::ErrorKind::FileTooLarge => Self::FileTooLarge { path, source },
            // Folders are made before their files, so one that is missing has been removed since.
            io::ErrorKind::NotFound => Self::Vanished { path },
            _ => Self::Write { path, source },
        }
    }

    /// Wraps a failed read.
    pub(crate) fn read(path: impl Into<PathBuf>, source: io::Error) -> Self {
        let path = path.into();
        match source.kind() {
            io::ErrorKind::NotFound => Self::NotFound { path },
            _ => Self::Read { path, source },
        }
    }
}
