//! The length that a video's container states of itself, to tell a file that was cut off from a whole one.
//!
//! ffmpeg plays a shorter file of most containers without a word. Layouts: RIFF (AVI), ISO 14496-12 (mp4, mov), RFC 9559
//! (Matroska, WebM), Adobe's FLV 10.1 with `filesize` in its onMetaData, Microsoft's ASF (WMV).

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};

/// What is missing of the file, in words; none if it is whole or its container does not say.
pub(super) fn cut_off(path: &Path) -> Option<String> {
    let mut file = File::open(path).ok()?;
    let found = file.metadata().ok()?.len();
    let stated = stated(&mut file, found).ok().flatten()?;
    (found < stated).then(|| format!("{found} of {stated} bytes are there"))
}

/// Bytes that the container states.
fn stated(file: &mut File, found: u64) -> io::Result<Option<u64>> {
    let mut head = Vec::new();
    file.by_ref().take(4096).read_to_end(&mut head)?;
    Ok(if head.starts_with(b"RIFF") && head.get(8..12) == Some(b"AVI ") {
        // Programs that never went back to fill the length in leave 0 or all ones.
        let stated = u64::from(u32::from_le_bytes(bytes(&head, 4))) + 8;
        (9..u64::from(u32::MAX)).contains(&stated).then_some(stated)
    } else if head.starts_with(b"FLV") {
        flv(&head)
    } else if head.starts_with(&[0x30, 0x26, 0xb2, 0x75, 0x8e, 0x66, 0xcf, 0x11]) {
        asf(&head)
    } else if head.starts_with(&[0x1a, 0x45, 0xdf, 0xa3]) {
        matroska(&head)
    } else if head
        .get(4..8)
        .is_some_and(|kind| matches!(kind, b"ftyp" | b"moov" | b"mdat" | b"wide" | b"free" | b"skip"))
    {
        boxes(file, found)?
    } else {
        None
    })
}

/// `N` bytes from `at` on; zeros where the file has ended.
fn bytes<const N: usize>(head: &[u8], at: usize) -> [u8; N] {
    head.get(at..at + N).and_then(|b| b.try_into().ok()).unwrap_or([0; N])
}

fn position(head: &[u8], what: &[u8]) -> Option<usize> {
    head.windows(what.len()).position(|w| w == what)
}

/// The number `filesize` of the first tag, an AMF0 double; 0 where the program could not go back to fill it in.
fn flv(head: &[u8]) -> Option<u64> {
    let at = position(head, b"filesize\0")? + 9;
    let size = f64::from_be_bytes(bytes(head, at));
    (size.is_finite() && size >= 13.0).then_some(size as u64)
}

/// The size in the file properties object, unless the file is a recorded broadcast (first bit of its flags).
fn asf(head: &[u8]) -> Option<u64> {
    const PROPERTIES: [u8; 16] =
        [0xa1, 0xdc, 0xab, 0x8c, 0x47, 0xa9, 0xcf, 0x11, 0x8e, 0xe4, 0x00, 0xc0, 0x0c, 0x20, 0x53, 0x65];
    let at = position(head, &PROPERTIES)?;
    let size = u64::from_le_bytes(bytes(head, at + 40));
    let broadcast = u32::from_le_bytes(bytes(head, at + 88)) & 1 == 1;
    (!broadcast && size > 0).then_some(size)
}

/// End of the segment, which holds everything after the header; unknown (all ones) in what was recorded live.
fn matroska(head: &[u8]) -> Option<u64> {
    let (header, after) = ebml_number(head, 4)?;
    let segment = after + usize::try_from(header).ok()?;
    if bytes(head, segment) != [0x18u8, 0x53, 0x80, 0x67] {
        return None;
    }
    let (size, after) = ebml_number(head, segment + 4)?;
    (after as u64).checked_add(size)
}

/// A number of one to eight bytes, as many as its first has leading zeros and one, and where it ends; none for "unknown".
fn ebml_number(head: &[u8], at: usize) -> Option<(u64, usize)> {
    let first = *head.get(at).filter(|first| **first != 0)?;
    let length = first.leading_zeros() as usize + 1;
    let rest = head.get(at + 1..at + length)?;
    let ones = (1u64 << (7 * length)) - 1;
    let start = u64::from(first) & ((1u64 << (8 - length)) - 1);
    let value = rest.iter().fold(start, |n, b| (n << 8) | u64::from(*b));
    (value != ones).then_some((value, at + length))
}

/// End of the last box of an ISO media file, walking from one to the next.
fn boxes(file: &mut File, found: u64) -> io::Result<Option<u64>> {
    /// More than any file has on its top level, fragments included.
    const MOST: usize = 1 << 20;
    let mut at = 0u64;
    for _ in 0..MOST {
        if at >= found {
            break;
        }
        file.seek(SeekFrom::Start(at))?;
        let mut head = [0u8; 16];
        let read = file.read(&mut head)?;
        // A few stray bytes behind the last box are no box.
        if read < 8 {
            return Ok(None);
        }
        let size = match u32::from_be_bytes([head[0], head[1], head[2], head[3]]) {
            // To the end of the file.
            0 => return Ok(None),
            1 => u64::from_be_bytes(bytes(&head, 8)),
            size => u64::from(size),
        };
        // What is no box says nothing of a length.
        if size < 8 || !head[4..8].iter().all(|b| b.is_ascii_graphic() || *b == b' ') {
            return Ok(None);
        }
        at = at.saturating_add(size);
    }
    Ok(Some(at))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_of_matroska() {
        assert_eq!(ebml_number(&[0x81], 0), Some((1, 1)));
        assert_eq!(ebml_number(&[0x40, 0x02], 0), Some((2, 2)));
        assert_eq!(ebml_number(&[0xff], 0), None, "unknown");
        assert_eq!(ebml_number(&[0x01, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff], 0), None, "unknown in eight bytes");
        assert_eq!(ebml_number(&[0x01, 0, 0, 0, 0, 0, 1, 0], 0), Some((256, 8)));
        assert_eq!(ebml_number(&[0x00, 1, 1, 1, 1, 1, 1, 1, 1], 0), None, "longer than eight bytes");
        assert_eq!(ebml_number(&[0x40], 0), None, "cut off");
    }

    #[test]
    fn boxes_of_mp4() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a");
        let whole =
            [&[0, 0, 0, 12][..], b"ftypisom", &[0, 0, 0, 1], b"mdat", &[0, 0, 0, 0, 0, 0, 0, 20], b"abcd"].concat();
        std::fs::write(&path, &whole).unwrap();
        assert_eq!(cut_off(&path), None);
        std::fs::write(&path, &whole[..30]).unwrap();
        assert_eq!(cut_off(&path).unwrap(), "30 of 32 bytes are there");
        std::fs::write(&path, [&whole[..12], &[0, 0, 0, 0], b"mdat and to the end"].concat()).unwrap();
        assert_eq!(cut_off(&path), None);
    }
}
