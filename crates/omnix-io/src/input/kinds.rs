//! What a file's name says of its kind.

use std::path::Path;

/// Extensions read as pictures, lower case.
pub const IMAGE_EXTENSIONS: &[&str] = &["png", "jpg", "jpeg", "webp", "bmp"];
/// Extensions handed to ffmpeg, lower case. A GIF is a video, of one frame where it does not move.
pub const VIDEO_EXTENSIONS: &[&str] = &["mp4", "mov", "avi", "mkv", "webm", "m4v", "flv", "wmv", "gif"];

/// The extension in lower case, without the dot; empty if the name has no extension.
pub(super) fn extension(path: &Path) -> String {
    path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default()
}

pub(crate) fn is_image(path: &Path) -> bool {
    IMAGE_EXTENSIONS.contains(&extension(path).as_str())
}

/// Whether a file of this name is handed to ffmpeg.
#[must_use]
pub fn is_video(path: &Path) -> bool {
    VIDEO_EXTENSIONS.contains(&extension(path).as_str())
}

/// Files and folders that systems and programs put beside a user's own: names that begin with a dot (macOS writes `._NAME` beside
/// every NAME on foreign drives), and the folder of such files in zip archives.
pub(crate) fn is_hidden(path: &Path) -> bool {
    path.file_name().is_some_and(|name| name.as_encoded_bytes().starts_with(b".") || name == "__MACOSX")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_the_kind() {
        assert!(is_image(Path::new("a/B.JPG")) && is_video(Path::new("c.MoV")) && !is_image(Path::new("jpg")));
        for hidden in ["a/._b.png", ".thumbs", "a/__MACOSX", ".ipynb_checkpoints"] {
            assert!(is_hidden(Path::new(hidden)), "{hidden}");
        }
        assert!(!is_hidden(Path::new(".a/b.png")) && !is_hidden(Path::new("..")));
    }
}
