//! Opening of plain files: a pipe or a device would block or never end.

use std::fs::{File, FileType};
use std::io;
use std::path::Path;

use crate::TensorError;

/// Opens a plain file for reading; gives its length too.
///
/// # Errors
/// [`TensorError::NotPlain`] for a folder, a pipe, a socket or a device, which is not opened; [`TensorError::Io`] otherwise.
pub(crate) fn open_plain(path: &Path) -> Result<(File, u64), TensorError> {
    let refused = |e: io::Error| TensorError::io("open the file", path, e);
    // Before it is opened: to open a pipe that nobody writes to waits for ever.
    check(std::fs::metadata(path).map_err(refused)?.file_type(), path)?;
    let file = File::open(path).map_err(refused)?;
    let meta = file.metadata().map_err(refused)?;
    check(meta.file_type(), path)?;
    Ok((file, meta.len()))
}

fn check(kind: FileType, path: &Path) -> Result<(), TensorError> {
    if kind.is_file() {
        return Ok(());
    }
    let found = if kind.is_dir() { "a folder" } else { "a pipe, socket or device" };
    Err(TensorError::NotPlain { found, path: path.to_owned() })
}

/// Reads a whole text file of at most `limit` bytes, without the byte-order mark that some editors put in front.
///
/// # Errors
/// [`TensorError::NotPlain`] and [`TensorError::Io`]; an error of kind `InvalidData` when the file is longer or is not UTF-8 text.
pub fn read_text(path: &Path, limit: u64) -> Result<String, TensorError> {
    use std::io::Read as _;

    let (file, length) = open_plain(path)?;
    let refused = |e: io::Error| TensorError::io("read the file", path, e);
    let too_long = || refused(io::Error::new(io::ErrorKind::InvalidData, format!("it has more than {limit} bytes")));
    if length > limit {
        return Err(too_long());
    }
    let mut bytes = Vec::with_capacity(length as usize);
    // The file may grow meanwhile.
    file.take(limit + 1).read_to_end(&mut bytes).map_err(refused)?;
    if bytes.len() as u64 > limit {
        return Err(too_long());
    }
    if bytes.starts_with(b"\xef\xbb\xbf") {
        bytes.drain(..3);
    }
    String::from_utf8(bytes).map_err(|_| refused(io::Error::new(io::ErrorKind::InvalidData, "it is not UTF-8 text")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_not_a_plain_file_is_not_opened() {
        let dir = tempfile::tempdir().unwrap();
        let error = open_plain(dir.path()).unwrap_err();
        assert!(matches!(error, TensorError::NotPlain { found: "a folder", .. }), "{error}");
        assert!(matches!(open_plain(&dir.path().join("none")), Err(TensorError::Io { .. })));
    }

    #[cfg(unix)]
    #[test]
    fn a_pipe_does_not_block() {
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("config.json");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        let error = read_text(&pipe, 100).unwrap_err().to_string();
        assert!(error.contains("a pipe") && error.contains("plain file"), "{error}");
    }

    #[test]
    fn texts_lose_their_mark_and_have_a_limit() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        for (bytes, expected) in [(&b"\xef\xbb\xbf{}"[..], Some("{}")), (b"{}", Some("{}")), (b"\xff\xfe{", None)] {
            std::fs::write(&path, bytes).unwrap();
            assert_eq!(read_text(&path, 5).ok().as_deref(), expected);
        }
        std::fs::write(&path, "123456").unwrap();
        let error = read_text(&path, 5).unwrap_err();
        assert!(matches!(&error, TensorError::Io { source, .. } if source.to_string().contains("5 bytes")), "{error}");
    }
}
