//! Width and height from the first bytes of a picture: PNG, JPEG, WebP, BMP.
//!
//! Written here because a plan of ten thousand frames must not read ten thousand whole files, which general decoders do for
//! JPEG. Layouts: PNG (W3C, section 11.2.2 IHDR), JPEG (ITU-T T.81, B.2.2 frame header), WebP (RFC 9649, VP8, VP8L and VP8X
//! chunks), BMP (BITMAPCOREHEADER, BITMAPINFOHEADER). The content decides, not the extension.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};

use crate::IoError;

/// Width and height in pixels, without decoding.
///
/// # Errors
/// A missing or unreadable file; content that is none of the four formats; a header that ends too early.
pub fn image_size(path: &Path) -> Result<(u32, u32), IoError> {
    let mut file = File::open(path).map_err(|e| IoError::read(path, e))?;
    match scan(&mut file) {
        Ok(Scan::Size(w, h)) if w > 0 && h > 0 => Ok((w, h)),
        Ok(Scan::Size(w, h)) => {
            Err(IoError::ImageDecode { reason: format!("a size of {w} x {h}"), path: path.to_owned() })
        }
        Ok(Scan::Other(found)) => Err(IoError::NotAnImage { found, path: path.to_owned() }),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
            Err(IoError::TruncatedImage { detail: "inside its header".into(), path: path.to_owned() })
        }
        Err(e) => Err(IoError::read(path, e)),
    }
}

enum Scan {
    Size(u32, u32),
    Other(String),
}

fn scan(file: &mut File) -> io::Result<Scan> {
    let mut head = Vec::with_capacity(32);
    file.by_ref().take(32).read_to_end(&mut head)?;
    let short = || io::Error::from(io::ErrorKind::UnexpectedEof);
    let be32 = |at: usize| head.get(at..at + 4).map(|b| u32::from_be_bytes([b[0], b[1], b[2], b[3]])).ok_or_else(short);
    let le32 = |at: usize| head.get(at..at + 4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).ok_or_else(short);
    let le16 = |at: usize| head.get(at..at + 2).map(|b| u32::from(u16::from_le_bytes([b[0], b[1]]))).ok_or_else(short);
    let le24 = |at: usize| head.get(at..at + 3).map(|b| u32::from_le_bytes([b[0], b[1], b[2], 0])).ok_or_else(short);
    if head.starts_with(b"\x89PNG\r\n\x1a\n") {
        return Ok(Scan::Size(be32(16)?, be32(20)?));
    }
    if head.starts_with(&[0xff, 0xd8, 0xff]) {
        return jpeg(file);
    }
    if head.starts_with(b"RIFF") && head.get(8..12) == Some(b"WEBP") {
        return Ok(match head.get(12..16).ok_or_else(short)? {
            b"VP8 " => Scan::Size(le16(26)? & 0x3fff, le16(28)? & 0x3fff),
            b"VP8L" => {
                let bits = le32(21)?;
                Scan::Size((bits & 0x3fff) + 1, ((bits >> 14) & 0x3fff) + 1)
            }
            b"VP8X" => Scan::Size(le24(24)? + 1, le24(27)? + 1),
            _ => Scan::Other("a WebP file with an unknown first chunk".into()),
        });
    }
    if head.starts_with(b"BM") {
        return Ok(match le32(14)? {
            12 => Scan::Size(le16(18)?, le16(20)?),
            // A negative height means rows from the top down.
            16 | 40 | 52 | 56 | 64 | 108 | 124 => Scan::Size(le32(18)?, (le32(22)? as i32).unsigned_abs()),
            _ => Scan::Other(describe(&head)),
        });
    }
    Ok(Scan::Other(describe(&head)))
}

/// Walks the marker segments of a JPEG up to its frame header.
fn jpeg(file: &mut File) -> io::Result<Scan> {
    file.seek(SeekFrom::Start(2))?;
    let mut file = io::BufReader::with_capacity(4096, file);
    let mut byte = [0u8; 1];
    loop {
        file.read_exact(&mut byte)?;
        if byte[0] != 0xff {
            return Ok(Scan::Other("a damaged JPEG header".into()));
        }
        // Any number of 0xff fill bytes may come before a marker.
        while byte[0] == 0xff {
            file.read_exact(&mut byte)?;
        }
        let marker = byte[0];
        if matches!(marker, 0x01 | 0xd0..=0xd7) {
            continue;
        }
        if matches!(marker, 0xd9 | 0xda) {
            return Ok(Scan::Other("a JPEG file without a frame".into()));
        }
        let mut length = [0u8; 2];
        file.read_exact(&mut length)?;
        let body = u16::from_be_bytes(length).saturating_sub(2);
        // Start-of-frame markers, all but DHT (c4), JPG (c8) and DAC (cc).
        if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) {
            let mut frame = [0u8; 5];
            file.read_exact(&mut frame)?;
            let side = |at: usize| u32::from(u16::from_be_bytes([frame[at], frame[at + 1]]));
            return Ok(Scan::Size(side(3), side(1)));
        }
        file.seek_relative(i64::from(body))?;
    }
}

/// Names what the first bytes look like, for the message.
pub(super) fn describe(head: &[u8]) -> String {
    let known: &[(&[u8], &str)] = &[
        (b"GIF8", "a GIF file"),
        (b"II*\0", "a TIFF file"),
        (b"MM\0*", "a TIFF file"),
        (b"%PDF", "a PDF file"),
        (b"PK\x03\x04", "a zip archive"),
        (b"\x1f\x8b", "a gzip archive"),
        (b"version https://git-lfs", "a Git LFS pointer (run `git lfs pull`)"),
        (b"<!DOCTYPE", "a web page"),
        (b"<html", "a web page"),
        (b"<svg", "an SVG drawing"),
        (b"\x7fELF", "a program"),
    ];
    if head.is_empty() {
        return "an empty file".into();
    }
    if let Some((_, name)) = known.iter().find(|(magic, _)| head.starts_with(magic)) {
        return (*name).into();
    }
    if head.get(4..8) == Some(b"ftyp") {
        return "an ISO media file (mp4, heic or avif)".into();
    }
    if head.iter().all(|b| b.is_ascii_graphic() || b.is_ascii_whitespace()) {
        return "text".into();
    }
    let bytes: Vec<String> = head.iter().take(4).map(|b| format!("{b:02x}")).collect();
    format!("unknown content (first bytes {})", bytes.join(" "))
}
