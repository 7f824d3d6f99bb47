//! The header of a safetensors file, read without trust.
//!
//! Layout: 8 bytes little-endian N, then N bytes of JSON `{name: {dtype, shape, data_offsets: [begin, end]},
//! "__metadata__": {string: string}}`, then the data, which the tensors cover without gap or overlap. The format's own
//! crate is not used for reading: it says of a short file only that it is incomplete, refuses the whole file for one
//! tensor of an unknown type, and adds up offsets unchecked.
//!
//! The JSON is parsed as a stream (`entries.rs`), with limits on whatever a hostile file could repeat, so that reading
//! takes no more memory than the text itself. A name that occurs twice is refused, as the format demands.

use std::path::Path;

use crate::info::Header;
use crate::{TensorError, entries, pytorch};

/// The format's own limit on the header, in bytes.
const MAX_HEADER: u64 = 100_000_000;
/// Bytes from the start of a file that tell whether it can be one.
pub(crate) const START: usize = 512;

/// The length of the JSON text, from the first bytes ([`START`], or all) of a file of `total` bytes.
pub(crate) fn length(start: &[u8], total: u64, path: &Path) -> Result<usize, TensorError> {
    let not = |reason: String| TensorError::NotSafetensors { path: path.to_owned(), reason };
    recognise_others(start, path)?;
    let Some((length, rest)) = start.split_first_chunk::<8>() else {
        return Err(TensorError::WrongLength { path: path.to_owned(), expected: 8, found: total });
    };
    let length = u64::from_le_bytes(*length);
    if length > MAX_HEADER || rest.first().is_some_and(|&b| b != b'{') {
        return Err(not("its first bytes are no header".to_owned()));
    }
    if length > total - 8 {
        return Err(TensorError::WrongLength { path: path.to_owned(), expected: length + 8, found: total });
    }
    // It fits: at most `MAX_HEADER`.
    Ok(length as usize)
}

/// Parses the JSON text of a file of `total` bytes and checks it against that length.
pub(crate) fn parse(json: &[u8], total: u64, path: &Path) -> Result<Header, TensorError> {
    let mut header = entries::read(json, path)?;
    let start = json.len() + 8;
    check_cover(&mut header, start, total - start as u64, path)?;
    Ok(header)
}

/// Tells the common wrong files apart, so that the message can name the cure.
fn recognise_others(bytes: &[u8], path: &Path) -> Result<(), TensorError> {
    // The same bytes may begin a valid length, but then the header follows.
    if bytes.get(8) == Some(&b'{') {
        return Ok(());
    }
    // The protocol of a bare pickle, which files began with before version 1.6; other protocols do not occur there.
    if bytes.starts_with(b"\x80\x02") {
        let reason = "it was saved by a PyTorch before 1.6, or as such; load and save it again in Python".to_owned();
        return Err(TensorError::PyTorch { path: path.to_owned(), reason });
    }
    if bytes.get(257..262) == Some(b"ustar") {
        let reason =
            "it is a tar archive, as PyTorch before 0.2 saved them; load and save it again in Python".to_owned();
        return Err(TensorError::PyTorch { path: path.to_owned(), reason });
    }
    let reason = if pytorch::is_archive(bytes) {
        "it is a zip archive"
    } else if bytes.is_empty() {
        "it is empty"
    } else if bytes.starts_with(b"version https://git-lfs") {
        "it is a git-lfs pointer: run git lfs pull"
    } else if bytes.starts_with(b"<!") || bytes.starts_with(b"<html") {
        "it is a web page: the download went wrong"
    } else {
        return Ok(());
    };
    Err(TensorError::NotSafetensors { path: path.to_owned(), reason: reason.to_owned() })
}

/// Checks that the tensors cover the `found` bytes of data exactly, and moves their ranges by `start`, where the data begins.
fn check_cover(header: &mut Header, start: usize, found: u64, path: &Path) -> Result<(), TensorError> {
    let mut covered = 0;
    for (name, info) in header.in_file_order() {
        if info.range.start != covered {
            return Err(TensorError::BadHeader {
                path: path.to_owned(),
                tensor: name.to_owned(),
                reason: format!("its data begins at {} instead of {covered}", info.range.start),
            });
        }
        covered = info.range.end;
    }
    let end = covered as u64;
    if end != found {
        // Saturating: a hostile header may name any offset; the numbers only go into the message.
        let (expected, found) = (end.saturating_add(start as u64), found + start as u64);
        return Err(TensorError::WrongLength { path: path.to_owned(), expected, found });
    }
    // No overflow: every range ends within the file.
    for info in header.tensors.values_mut() {
        info.range = info.range.start + start..info.range.end + start;
    }
    Ok(())
}
