//! Size, turn and cost of a picture from its header: PNG, JPEG, WebP, BMP.
//!
//! Written here because a plan of ten thousand frames must not read ten thousand whole files, which general decoders do for
//! JPEG. Layouts: PNG (W3C, section 11.2.2 IHDR), JPEG (ITU-T T.81, B.2.2 frame header), WebP (RFC 9649, VP8, VP8L and VP8X
//! chunks), BMP (BITMAPCOREHEADER, BITMAPINFOHEADER), EXIF (CIPA DC-008) in a JPEG's APP1, a PNG's eXIf, a WebP's EXIF. The
//! content decides, not the extension.

use std::{
    fs::File,
    io::{self, BufReader, Read, Seek, SeekFrom},
    path::Path,
};

use image::metadata::Orientation;

use crate::IoError;

/// What a picture's header says.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Header {
    /// Stored width in pixels.
    pub(super) width: u32,
    /// Stored height in pixels.
    pub(super) height: u32,
    /// What makes it upright.
    pub(super) orientation: Orientation,
    /// Bytes that decoding to 8-bit RGB and turning it take at most, the file and the result included.
    pub(super) bytes: u64,
}

impl Header {
    /// Width and height upright.
    pub(super) fn upright(&self) -> (u32, u32) {
        use Orientation::{Rotate90, Rotate90FlipH, Rotate270, Rotate270FlipH};
        match self.orientation {
            Rotate90 | Rotate270 | Rotate90FlipH | Rotate270FlipH => (self.height, self.width),
            _ => (self.width, self.height),
        }
    }
}

/// Width and height in pixels, upright, without decoding.
///
/// # Errors
/// A missing or unreadable file; content that is not one of the four formats; a header that ends too early.
pub fn image_size(path: &Path) -> Result<(u32, u32), IoError> {
    header(path).map(|h| h.upright())
}

/// Reads the header of a picture.
pub(super) fn header(path: &Path) -> Result<Header, IoError> {
    // A pipe or device would keep whoever opens it waiting.
    let meta = std::fs::metadata(path).map_err(|e| IoError::read(path, e))?;
    if !meta.is_file() {
        return Err(IoError::NotAPlainFile { path: path.to_owned() });
    }
    let mut file = File::open(path).map_err(|e| IoError::read(path, e))?;
    match scan(&mut file) {
        Ok(Scan::Found(found)) if found.width > 0 && found.height > 0 => Ok(found.header(meta.len())),
        Ok(Scan::Found(Found { width, height, .. })) => {
            Err(IoError::ImageDecode { reason: format!("a size of {width} x {height}"), path: path.to_owned() })
        }
        Ok(Scan::Other(found)) => Err(IoError::NotAnImage { found, path: path.to_owned() }),
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
            Err(IoError::TruncatedImage { detail: "inside its header".into(), path: path.to_owned() })
        }
        Err(e) => Err(IoError::read(path, e)),
    }
}

enum Scan {
    Found(Found),
    Other(String),
}

struct Found {
    width: u32,
    height: u32,
    orientation: Option<Orientation>,
    cost: Cost,
}

/// Bytes a pixel that a decoder holds at a time.
#[derive(Clone, Copy)]
struct Cost {
    /// Beside its output while it decodes.
    work: u64,
    /// Its output.
    output: u64,
    /// Whether its output is 8-bit RGB already.
    rgb: bool,
}

impl Found {
    fn new(width: u32, height: u32, cost: Cost) -> Self {
        Self { width, height, orientation: None, cost }
    }

    fn header(&self, file: u64) -> Header {
        let Cost { work, output, rgb } = self.cost;
        let orientation = self.orientation.unwrap_or(Orientation::NoTransforms);
        let convert = if rgb { output } else { output + 3 };
        let turn = if orientation == Orientation::NoTransforms { 3 } else { 6 };
        let most = (work + output).max(convert).max(turn);
        let pixels = u64::from(self.width) * u64::from(self.height);
        // The file's bytes are held twice while some decoders run.
        let bytes = pixels.saturating_mul(most).saturating_add(2 * file);
        Header { width: self.width, height: self.height, orientation, bytes }
    }
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
        let (width, height) = (be32(16)?, be32(20)?);
        let form = head.get(24..26).ok_or_else(short)?;
        let deep = if form[0] == 16 { 2 } else { 1 };
        // Grey, RGB, palette (which may have transparent colours), grey with alpha, RGBA.
        let channels = match form[1] {
            0 => 1,
            2 => 3,
            4 => 2,
            _ => 4,
        };
        let cost = Cost { work: 0, output: deep * channels, rgb: (deep, channels) == (1, 3) };
        let orientation = png_exif(file).and_then(|exif| Orientation::from_exif_chunk(&exif));
        return Ok(Scan::Found(Found { orientation, ..Found::new(width, height, cost) }));
    }
    if head.starts_with(&[0xff, 0xd8, 0xff]) {
        return jpeg(file);
    }
    if head.starts_with(b"RIFF") && head.get(8..12) == Some(b"WEBP") {
        // The decoder's frame (lossless: RGBA) beside its output of three or four bytes.
        let cost = Cost { work: 4, output: 4, rgb: false };
        return Ok(match head.get(12..16).ok_or_else(short)? {
            b"VP8 " => Scan::Found(Found::new(le16(26)? & 0x3fff, le16(28)? & 0x3fff, cost)),
            b"VP8L" => {
                let bits = le32(21)?;
                Scan::Found(Found::new((bits & 0x3fff) + 1, ((bits >> 14) & 0x3fff) + 1, cost))
            }
            b"VP8X" => {
                let exif = if le32(20)? & 8 == 0 { None } else { webp_exif(file) };
                let orientation = exif.and_then(|exif| Orientation::from_exif_chunk(&exif));
                Scan::Found(Found { orientation, ..Found::new(le24(24)? + 1, le24(27)? + 1, cost) })
            }
            _ => Scan::Other("a WebP file with an unknown first chunk".into()),
        });
    }
    if head.starts_with(b"BM") {
        let cost = Cost { work: 0, output: 4, rgb: false };
        return Ok(match le32(14)? {
            12 => Scan::Found(Found::new(le16(18)?, le16(20)?, cost)),
            // A negative height means rows from the top down.
            16 | 40 | 52 | 56 | 64 | 108 | 124 => {
                Scan::Found(Found::new(le32(18)?, (le32(22)? as i32).unsigned_abs(), cost))
            }
            _ => Scan::Other(describe(&head)),
        });
    }
    Ok(Scan::Other(describe(&head)))
}

/// Walks the marker segments of a JPEG up to its frame header.
fn jpeg(file: &mut File) -> io::Result<Scan> {
    file.seek(SeekFrom::Start(2))?;
    let mut file = BufReader::with_capacity(4096, file);
    let mut byte = [0u8; 1];
    let mut orientation = None;
    let mut frame: Option<Frame> = None;
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
        let mut length = [0u8; 2];
        if marker != 0xd9 {
            file.read_exact(&mut length)?;
        }
        let body = u16::from_be_bytes(length).saturating_sub(2);
        if matches!(marker, 0xd9 | 0xda) {
            let Some(frame) = frame else { return Ok(Scan::Other("a JPEG file without a frame".into())) };
            if marker == 0xda {
                file.read_exact(&mut byte)?;
            }
            let (width, height, cost) = frame.cost(byte[0]);
            return Ok(Scan::Found(Found { orientation, ..Found::new(width, height, cost) }));
        }
        // Start-of-frame markers, all but DHT (c4), JPG (c8) and DAC (cc).
        if matches!(marker, 0xc0..=0xcf) && !matches!(marker, 0xc4 | 0xc8 | 0xcc) && frame.is_none() {
            let mut segment = vec![0; usize::from(body)];
            file.read_exact(&mut segment)?;
            frame = Some(Frame::new(marker, &segment).ok_or(io::ErrorKind::UnexpectedEof)?);
            continue;
        }
        if marker == 0xe1 && orientation.is_none() {
            let mut segment = vec![0; usize::from(body)];
            file.read_exact(&mut segment)?;
            orientation = segment.strip_prefix(b"Exif\0\0").and_then(Orientation::from_exif_chunk);
        } else {
            file.seek_relative(i64::from(body))?;
        }
    }
}

/// What a JPEG's frame header says.
struct Frame {
    width: u32,
    height: u32,
    components: u8,
    progressive: bool,
    /// Bytes of all coefficients, 16 bits each, by pixels.
    coefficients: u64,
}

impl Frame {
    fn new(marker: u8, segment: &[u8]) -> Option<Self> {
        let side = |at: usize| Some(u32::from(u16::from_be_bytes([*segment.get(at)?, *segment.get(at + 1)?])));
        let components = *segment.get(5)?;
        // Horizontal and vertical sampling of each component, four bits each.
        let factors = segment[6..].chunks_exact(3).map(|c| (u64::from(c[1] >> 4).max(1), u64::from(c[1] & 15).max(1)));
        let (across, down) = factors.clone().fold((1, 1), |(a, b), (h, v)| (a.max(h), b.max(v)));
        let samples: u64 = factors.map(|(h, v)| h * v).sum();
        let coefficients = (2 * samples).div_ceil(across * down);
        let progressive = !matches!(marker, 0xc0 | 0xc1);
        Some(Self { width: side(3)?, height: side(1)?, components, progressive, coefficients })
    }

    /// Size, and what decoding holds. Unless all components come in the first scan, all coefficients are kept to the end.
    fn cost(&self, in_first_scan: u8) -> (u32, u32, Cost) {
        let kept = self.progressive || in_first_scan < self.components;
        let output = if self.components == 1 { 1 } else { 3 };
        let cost = Cost { work: if kept { self.coefficients } else { 0 }, output, rgb: output == 3 };
        (self.width, self.height, cost)
    }
}

/// Longer EXIF data than any camera writes.
const EXIF_AT_MOST: u32 = 1 << 20;

/// The eXIf chunk before a PNG's pixels.
fn png_exif(file: &mut File) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(8)).ok()?;
    let mut file = BufReader::with_capacity(4096, file);
    loop {
        let mut head = [0u8; 8];
        file.read_exact(&mut head).ok()?;
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]);
        match &head[4..] {
            b"eXIf" => return chunk(&mut file, length),
            b"IDAT" | b"IEND" => return None,
            _ => file.seek_relative(i64::from(length) + 4).ok()?,
        }
    }
}

/// The EXIF chunk of a WebP file, which comes after its pixels.
fn webp_exif(file: &mut File) -> Option<Vec<u8>> {
    file.seek(SeekFrom::Start(12)).ok()?;
    let mut file = BufReader::with_capacity(4096, file);
    loop {
        let mut head = [0u8; 8];
        file.read_exact(&mut head).ok()?;
        let length = u32::from_le_bytes([head[4], head[5], head[6], head[7]]);
        if head.starts_with(b"EXIF") {
            let exif = chunk(&mut file, length)?;
            // Some programs keep JPEG's prefix.
            return Some(exif.strip_prefix(b"Exif\0\0").map_or_else(|| exif.clone(), <[u8]>::to_vec));
        }
        file.seek_relative(i64::from(length) + i64::from(length & 1)).ok()?;
    }
}

fn chunk(file: &mut impl Read, length: u32) -> Option<Vec<u8>> {
    let mut bytes = Vec::new();
    file.take(u64::from(length.min(EXIF_AT_MOST))).read_to_end(&mut bytes).ok()?;
    Some(bytes)
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
