//! Arrays in numpy's NPY format, versions 1 to 3, C order.
//!
//! `\x93NUMPY`, version (2 bytes), length of the header (u16, from version 2 u32), the header as a Python dictionary with `descr`,
//! `fortran_order` and `shape`, then the elements. Read here and not by npyz, which multiplies the sizes of an untrusted header unchecked
//! and takes in any Python literal, however deep.

use std::path::{Path, PathBuf};

use super::{folder, pickle};
use crate::EvalError;

const WHAT: &str = "NPY array";

/// An array, its elements still as they are stored.
#[derive(Debug, Clone)]
pub struct Array {
    name: String,
    path: PathBuf,
    kind: Kind,
    big_endian: bool,
    shape: Vec<usize>,
    data: Vec<u8>,
    /// Where the elements begin.
    start: usize,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bool,
    /// Bytes of an element.
    Unsigned(usize),
    Signed(usize),
    Float(usize),
    /// Byte strings of a fixed length, filled with zeros.
    Bytes(usize),
    /// Pickled.
    Object,
}

impl Kind {
    fn size(self) -> Option<usize> {
        match self {
            Self::Bool => Some(1),
            Self::Unsigned(size) | Self::Signed(size) | Self::Float(size) | Self::Bytes(size) => Some(size),
            Self::Object => None,
        }
    }
}

/// Reads a file.
///
/// # Errors
/// [`EvalError::Read`], [`EvalError::Format`].
pub fn read(path: &Path) -> Result<Array, EvalError> {
    Array::parse(&folder::stem(path), path, folder::bytes(path)?)
}

impl Array {
    /// Reads an array's header; `path` is the file it came from, for messages.
    ///
    /// # Errors
    /// [`EvalError::Format`] if the bytes are no NPY array in C order, or not as many as the header says.
    pub fn parse(name: &str, path: &Path, data: Vec<u8>) -> Result<Self, EvalError> {
        let wrong = |reason: &str| EvalError::format(WHAT, format!("{name}: {reason}"), path);
        let version = data.get(6).copied().filter(|_| data.starts_with(b"\x93NUMPY"));
        let (length, start): (usize, usize) = match (version, data.get(8..12)) {
            (Some(1), Some(b)) => (usize::from(u16::from_le_bytes([b[0], b[1]])), 10),
            (Some(2 | 3), Some(b)) => (u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as usize, 12),
            _ => return Err(wrong("it does not begin as such arrays do")),
        };
        let end = start.checked_add(length).ok_or_else(|| wrong("its header has no end"))?;
        let header = data.get(start..end).and_then(|text| std::str::from_utf8(text).ok());
        let header = header.ok_or_else(|| wrong("its header is cut short or no text"))?;
        let descr = quoted(field(header, "descr")).ok_or_else(|| wrong("its elements are of a structured type"))?;
        let (big_endian, kind) = kind(descr).ok_or_else(|| wrong(&format!("elements of type {descr} are not read")))?;
        let shape = shape(field(header, "shape")).ok_or_else(|| wrong("its shape is no tuple of sizes"))?;
        if !field(header, "fortran_order").starts_with("False") && shape.len() > 1 {
            return Err(wrong("it is in Fortran order; save numpy.ascontiguousarray of it"));
        }
        let count = shape.iter().try_fold(1usize, |product, &size| product.checked_mul(size));
        let needed = match kind.size() {
            Some(size) => count.and_then(|n| n.checked_mul(size)).ok_or_else(|| wrong("its shape overflows"))?,
            None => data.len() - end,
        };
        if data.len() - end != needed {
            return Err(wrong(&format!("{} bytes where its shape {shape:?} needs {needed}", data.len() - end)));
        }
        Ok(Self { name: name.to_owned(), path: path.to_owned(), kind, big_endian, shape, data, start: end })
    }

    /// The sizes of its axes.
    #[must_use]
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// Checks the shape; an axis of `None` may have any size. `expected` says it in words.
    ///
    /// # Errors
    /// [`EvalError::Shape`].
    pub fn expect(&self, axes: &[Option<usize>], expected: &str) -> Result<(), EvalError> {
        let fits = |(axis, size): (&Option<usize>, &usize)| axis.is_none_or(|axis| axis == *size);
        if axes.len() == self.shape.len() && axes.iter().zip(&self.shape).all(fits) {
            return Ok(());
        }
        let (name, found) = (self.name.clone(), self.shape.clone());
        Err(EvalError::Shape { name, expected: expected.to_owned(), found, path: self.path.clone() })
    }

    /// The elements as f64. Whole numbers beyond 2^53 are rounded.
    ///
    /// # Errors
    /// [`EvalError::Format`] for elements that are no numbers.
    pub fn f64s(&self) -> Result<Vec<f64>, EvalError> {
        self.numbers(|v| v)
    }

    /// The elements as f32.
    ///
    /// # Errors
    /// As [`Array::f64s`].
    pub fn f32s(&self) -> Result<Vec<f32>, EvalError> {
        self.numbers(|v| v as f32)
    }

    /// The elements in threes.
    ///
    /// # Errors
    /// As [`Array::f64s`].
    pub fn points(&self) -> Result<Vec<[f64; 3]>, EvalError> {
        Ok(self.f64s()?.as_chunks::<3>().0.to_vec())
    }

    /// Whether each element is true, or a number other than 0.
    ///
    /// # Errors
    /// As [`Array::f64s`].
    pub fn bools(&self) -> Result<Vec<bool>, EvalError> {
        self.numbers(|v| v != 0.0)
    }

    fn numbers<T>(&self, of: impl Fn(f64) -> T) -> Result<Vec<T>, EvalError> {
        let bytes = &self.data[self.start..];
        let read: fn(&[u8], bool) -> f64 = match self.kind {
            Kind::Bool | Kind::Unsigned(1) => |b, _| f64::from(b[0]),
            Kind::Unsigned(2) => |b, big| f64::from(u16::from_le_bytes(ordered(b, big))),
            Kind::Unsigned(4) => |b, big| f64::from(u32::from_le_bytes(ordered(b, big))),
            Kind::Unsigned(8) => |b, big| u64::from_le_bytes(ordered(b, big)) as f64,
            Kind::Signed(1) => |b, _| f64::from(b[0].cast_signed()),
            Kind::Signed(2) => |b, big| f64::from(i16::from_le_bytes(ordered(b, big))),
            Kind::Signed(4) => |b, big| f64::from(i32::from_le_bytes(ordered(b, big))),
            Kind::Signed(8) => |b, big| i64::from_le_bytes(ordered(b, big)) as f64,
            Kind::Float(2) => |b, big| half::f16::from_le_bytes(ordered(b, big)).to_f64(),
            Kind::Float(4) => |b, big| f64::from(f32::from_le_bytes(ordered(b, big))),
            Kind::Float(8) => |b, big| f64::from_le_bytes(ordered(b, big)),
            _ => return Err(EvalError::format(WHAT, format!("{}: no numbers", self.name), &self.path)),
        };
        let size = self.kind.size().unwrap_or(1);
        Ok(bytes.chunks_exact(size).map(|b| of(read(b, self.big_endian))).collect())
    }

    /// The elements as byte strings: fixed ones without the zeros at their end, or pickled ones.
    ///
    /// # Errors
    /// [`EvalError::Format`] for elements of another type.
    pub fn byte_strings(&self) -> Result<Vec<Vec<u8>>, EvalError> {
        let bytes = &self.data[self.start..];
        let trimmed = |b: &[u8]| b[..b.iter().rposition(|&v| v != 0).map_or(0, |last| last + 1)].to_vec();
        match self.kind {
            Kind::Bytes(0) => Ok(vec![Vec::new(); self.shape.iter().product::<usize>().min(1)]),
            Kind::Bytes(size) => Ok(bytes.chunks_exact(size).map(trimmed).collect()),
            Kind::Object => pickle::byte_strings(bytes)
                .map_err(|e| EvalError::format(WHAT, format!("{}: {e}", self.name), &self.path)),
            _ => Err(EvalError::format(WHAT, format!("{}: no byte strings", self.name), &self.path)),
        }
    }
}

/// `N` bytes in little-endian order.
fn ordered<const N: usize>(bytes: &[u8], big_endian: bool) -> [u8; N] {
    let mut out = [0; N];
    out.copy_from_slice(&bytes[..N]);
    if big_endian {
        out.reverse();
    }
    out
}

/// What follows `'name':` in a header.
fn field<'a>(header: &'a str, name: &str) -> &'a str {
    let found = ['\'', '"'].iter().find_map(|quote| header.split_once(&format!("{quote}{name}{quote}:")));
    found.map_or("", |(_, rest)| rest.trim_start())
}

fn quoted(text: &str) -> Option<&str> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    text[1..].split_once(quote).map(|(inner, _)| inner)
}

/// Byte order and kind of a description such as `<f4`.
fn kind(descr: &str) -> Option<(bool, Kind)> {
    let rest = descr.trim_start_matches(['<', '>', '|', '=']);
    if rest == "O" {
        return Some((false, Kind::Object));
    }
    let letter = rest.chars().next()?;
    let size: usize = rest.get(1..)?.parse().ok()?;
    let kind = match (letter, size) {
        ('b', 1) => Kind::Bool,
        ('u', 1 | 2 | 4 | 8) => Kind::Unsigned(size),
        ('i', 1 | 2 | 4 | 8) => Kind::Signed(size),
        ('f', 2 | 4 | 8) => Kind::Float(size),
        ('S' | 'a', _) => Kind::Bytes(size),
        _ => return None,
    };
    Some((descr.starts_with('>'), kind))
}

/// The sizes of `(3, 4)`, `(3,)` or `()`.
fn shape(text: &str) -> Option<Vec<usize>> {
    let (inner, _) = text.strip_prefix('(')?.split_once(')')?;
    let sizes = inner.split(',').map(str::trim).filter(|size| !size.is_empty());
    sizes.map(|size| size.trim_end_matches('L').parse().ok()).collect()
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// An NPY 1.0 file.
    pub(crate) fn npy(descr: &str, shape: &str, body: &[u8]) -> Vec<u8> {
        let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(body);
        bytes
    }

    fn parse(bytes: Vec<u8>) -> Result<Array, EvalError> {
        Array::parse("x", Path::new("x.npy"), bytes)
    }

    #[test]
    fn numbers_of_every_type_and_order() {
        let of = |descr: &str, body: &[u8]| parse(npy(descr, "(2,)", body)).unwrap().f64s().unwrap();
        assert_eq!(of("<f4", &[1.5f32.to_le_bytes(), (-2.0f32).to_le_bytes()].concat()), [1.5, -2.0]);
        assert_eq!(of(">f8", &[1.5f64.to_be_bytes(), (-2.0f64).to_be_bytes()].concat()), [1.5, -2.0]);
        assert_eq!(of("<f2", &[0x00, 0x3c, 0x00, 0xc0]), [1.0, -2.0]);
        assert_eq!(of("|u1", &[7, 255]), [7.0, 255.0]);
        assert_eq!(of("|i1", &[7, 255]), [7.0, -1.0]);
        assert_eq!(of(">u2", &[1, 0, 0, 2]), [256.0, 2.0]);
        assert_eq!(of("<i8", &[(-3i64).to_le_bytes(), 4i64.to_le_bytes()].concat()), [-3.0, 4.0]);
        assert_eq!(parse(npy("|b1", "(2,)", &[1, 0])).unwrap().bools().unwrap(), [true, false]);
        assert_eq!(
            parse(npy("|S3", "(2,)", b"ab\0cde")).unwrap().byte_strings().unwrap(),
            [b"ab".to_vec(), b"cde".to_vec()]
        );
    }

    #[test]
    fn scalars_and_shapes() {
        assert_eq!(parse(npy("|u1", "()", &[3])).unwrap().f64s().unwrap(), [3.0]);
        let array = parse(npy("|u1", "(2, 3)", &[0; 6])).unwrap();
        assert!(array.expect(&[None, Some(3)], "[N, 3]").is_ok());
        assert!(matches!(array.expect(&[None, Some(2)], "[N, 2]"), Err(EvalError::Shape { .. })));
    }

    #[test]
    fn untrusted_headers_are_errors() {
        let huge = "(18446744073709551615, 18446744073709551615)";
        let bad = [
            npy("<f4", huge, &[]),
            npy("<f4", "(3,)", &[0; 8]),
            npy("<f4", "(x,)", &[0; 4]),
            npy("<c8", "(1,)", &[0; 8]),
            npy("<f99999999999999999999", "(1,)", &[0; 8]),
            b"\x93NUMPY\x02\x00\xff\xff\xff\xff{".to_vec(),
            b"\x93NUMPY\x01".to_vec(),
            b"PK\x03\x04".to_vec(),
            Vec::new(),
        ];
        for bytes in bad {
            assert!(
                matches!(parse(bytes.clone()), Err(EvalError::Format { .. })),
                "{:?}",
                String::from_utf8_lossy(&bytes)
            );
        }
        let mut turned = npy("|u1", "(2, 2)", &[0; 4]);
        let at = turned.windows(5).position(|w| w == b"False").unwrap();
        turned[at..at + 5].copy_from_slice(b"True ");
        assert!(parse(turned).unwrap_err().to_string().contains("Fortran"));
        assert!(parse(npy("|S2", "(1,)", b"ab")).unwrap().f64s().is_err());
        assert!(parse(npy("|O", "(1,)", b"garbage")).unwrap().byte_strings().is_err());
    }
}
