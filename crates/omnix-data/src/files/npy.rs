//! One array in numpy's NPY format, versions 1 to 3.
//!
//! Layout: `\x93NUMPY`, two bytes of version, the length of the header (u16, from version 2 on u32, little endian), the header as a
//! Python dictionary `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4), }`, then the elements. Numbers and truth values of
//! either byte order are read; strings, records and pickled objects are not. Our own parser and not npyz (which the tests write
//! with): that one panics where the product of a shape overflows, and takes the memory that a header asks for.

use std::io::Read;
use std::path::{Path, PathBuf};

use half::f16;

use super::MOST;
use crate::DataError;

/// A header longer than this is refused.
const LONGEST_HEADER: u32 = 1 << 16;

/// Type of the elements.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bool,
    Float(usize),
    Signed(usize),
    Unsigned(usize),
}

impl Kind {
    const fn size(self) -> usize {
        match self {
            Self::Bool => 1,
            Self::Float(size) | Self::Signed(size) | Self::Unsigned(size) => size,
        }
    }
}

/// An array of numbers.
#[derive(Debug, Clone)]
pub(crate) struct Array {
    /// Name in its archive, or of its file.
    name: String,
    path: PathBuf,
    /// Slowest first.
    shape: Vec<usize>,
    kind: Kind,
    /// Row-major, little endian.
    bytes: Vec<u8>,
}

impl Array {
    /// Reads an array from the beginning of an NPY file.
    pub(crate) fn read(reader: &mut dyn Read, name: &str, path: &Path) -> Result<Self, DataError> {
        let refuse = |reason: String| DataError::Array { array: name.to_owned(), reason, path: path.to_owned() };
        let cut_off = |_| refuse("is cut off in its header".to_owned());
        let mut start = [0; 8];
        reader.read_exact(&mut start).map_err(cut_off)?;
        if start[..6] != *b"\x93NUMPY" {
            return Err(refuse("is not in numpy's format".to_owned()));
        }
        let length = if start[6] == 1 {
            let mut length = [0; 2];
            reader.read_exact(&mut length).map_err(cut_off)?;
            u32::from(u16::from_le_bytes(length))
        } else {
            let mut length = [0; 4];
            reader.read_exact(&mut length).map_err(cut_off)?;
            u32::from_le_bytes(length)
        };
        if length > LONGEST_HEADER {
            return Err(refuse(format!("has a header of {length} bytes")));
        }
        let mut text = vec![0; length as usize];
        reader.read_exact(&mut text).map_err(cut_off)?;
        let text = String::from_utf8_lossy(&text).into_owned();
        let header = Header::parse(&text)
            .ok_or_else(|| refuse(format!("has a header that is not understood: {}", text.trim())))?;
        let Header { big_endian, kind, fortran, shape } = header.map_err(refuse)?;
        let elements = shape.iter().try_fold(1usize, |product, size| product.checked_mul(*size));
        let needed = elements.and_then(|n| n.checked_mul(kind.size())).filter(|bytes| *bytes as u64 <= MOST);
        let Some(needed) = needed else {
            return Err(refuse(format!("says that its shape is {shape:?}, which is more than {} GiB", MOST >> 30)));
        };
        // Memory grows with what is there, not with what the header says.
        let mut bytes = Vec::new();
        let read =
            reader.take(needed as u64).read_to_end(&mut bytes).map_err(|source| DataError::read(path, source))?;
        if read < needed {
            return Err(refuse(format!("is cut off: {read} of {needed} bytes are there")));
        }
        if big_endian {
            bytes.chunks_exact_mut(kind.size()).for_each(<[u8]>::reverse);
        }
        if fortran {
            bytes = row_major(&bytes, &shape, kind.size());
        }
        Ok(Self { name: name.to_owned(), path: path.to_owned(), shape, kind, bytes })
    }

    pub(crate) fn shape(&self) -> &[usize] {
        &self.shape
    }

    /// The array, if its shape is this one; 0 stands for any size.
    pub(crate) fn expect(self, shape: &[usize]) -> Result<Self, DataError> {
        let fits = shape.len() == self.shape.len()
            && shape.iter().zip(&self.shape).all(|(want, have)| *want == 0 || want == have);
        if fits {
            return Ok(self);
        }
        let sizes: Vec<String> = shape.iter().map(|&n| if n == 0 { "any".to_owned() } else { n.to_string() }).collect();
        let Self { name: array, path, shape: found, .. } = self;
        Err(DataError::ArrayShape { array, expected: format!("[{}]", sizes.join(", ")), found, path })
    }

    /// An error about this array.
    pub(crate) fn wrong(&self, reason: impl Into<String>) -> DataError {
        DataError::Array { array: self.name.clone(), reason: reason.into(), path: self.path.clone() }
    }

    /// The elements; 64-bit integers beyond 2^53 are rounded.
    pub(crate) fn to_f64(&self) -> Vec<f64> {
        self.map(|v| v)
    }

    pub(crate) fn to_f32(&self) -> Vec<f32> {
        self.map(|v| v as f32)
    }

    /// Whether each element is other than 0.
    pub(crate) fn to_bools(&self) -> Vec<bool> {
        self.map(|v| v != 0.0)
    }

    fn map<T>(&self, to: impl Fn(f64) -> T) -> Vec<T> {
        fn each<const N: usize, T>(bytes: &[u8], to: impl Fn([u8; N]) -> T) -> Vec<T> {
            bytes.as_chunks::<N>().0.iter().map(|bytes| to(*bytes)).collect()
        }
        let bytes = &self.bytes;
        match self.kind {
            Kind::Bool | Kind::Unsigned(1) => each(bytes, |[b]| to(f64::from(b))),
            Kind::Signed(1) => each(bytes, |b| to(f64::from(i8::from_le_bytes(b)))),
            Kind::Float(2) => each(bytes, |b| to(f16::from_le_bytes(b).to_f64())),
            Kind::Unsigned(2) => each(bytes, |b| to(f64::from(u16::from_le_bytes(b)))),
            Kind::Signed(2) => each(bytes, |b| to(f64::from(i16::from_le_bytes(b)))),
            Kind::Float(4) => each(bytes, |b| to(f64::from(f32::from_le_bytes(b)))),
            Kind::Unsigned(4) => each(bytes, |b| to(f64::from(u32::from_le_bytes(b)))),
            Kind::Signed(4) => each(bytes, |b| to(f64::from(i32::from_le_bytes(b)))),
            Kind::Float(_) => each(bytes, |b| to(f64::from_le_bytes(b))),
            Kind::Unsigned(_) => each(bytes, |b| to(u64::from_le_bytes(b) as f64)),
            Kind::Signed(_) => each(bytes, |b| to(i64::from_le_bytes(b) as f64)),
        }
    }
}

/// What a header says.
struct Header {
    big_endian: bool,
    kind: Kind,
    fortran: bool,
    shape: Vec<usize>,
}

impl Header {
    /// None where this is no such dictionary; an inner error where it is and its elements are of a type that is not read.
    fn parse(text: &str) -> Option<Result<Self, String>> {
        let value = |key: &str| {
            let at = text.find(&format!("'{key}'")).or_else(|| text.find(&format!("\"{key}\"")))?;
            Some(text[at + key.len() + 2..].trim_start().strip_prefix(':')?.trim_start())
        };
        let fortran = match value("fortran_order")? {
            v if v.starts_with("True") => true,
            v if v.starts_with("False") => false,
            _ => return None,
        };
        let (sizes, _) = value("shape")?.strip_prefix('(')?.split_once(')')?;
        let sizes = sizes.split(',').map(str::trim).filter(|size| !size.is_empty());
        let shape = sizes.map(|size| size.parse().ok()).collect::<Option<Vec<usize>>>()?;
        let descr = value("descr")?;
        let Some(name) = descr.strip_prefix(['\'', '"']).and_then(|rest| rest.split(['\'', '"']).next()) else {
            return Some(Err("is an array of records, which are not read".to_owned()));
        };
        Some(match Self::kind(name) {
            Some((big_endian, kind)) => Ok(Self { big_endian, kind, fortran, shape }),
            None if name.contains('O') => Err("holds pickled Python objects, which are not read".to_owned()),
            None => Err(format!("has elements of type {name}, which are not read")),
        })
    }

    fn kind(name: &str) -> Option<(bool, Kind)> {
        let (order, rest) = name.split_at_checked(1)?;
        let (letter, size) = rest.split_at_checked(1)?;
        let kind = match (letter, size.parse().ok()?) {
            ("b", 1) => Kind::Bool,
            ("f", size @ (2 | 4 | 8)) => Kind::Float(size),
            ("i", size @ (1 | 2 | 4 | 8)) => Kind::Signed(size),
            ("u", size @ (1 | 2 | 4 | 8)) => Kind::Unsigned(size),
            _ => return None,
        };
        matches!(order, "<" | ">" | "|" | "=").then_some((order == ">", kind))
    }
}

/// Elements whose first index runs fastest, with the last index fastest.
fn row_major(bytes: &[u8], shape: &[usize], size: usize) -> Vec<u8> {
    let mut out = Vec::with_capacity(bytes.len());
    let mut index = vec![0; shape.len()];
    for _ in 0..bytes.len() / size.max(1) {
        let at = index.iter().zip(shape).rev().fold(0, |at, (i, n)| at * n + i) * size;
        out.extend_from_slice(&bytes[at..at + size]);
        for (i, n) in index.iter_mut().zip(shape).rev() {
            *i += 1;
            if *i < *n {
                break;
            }
            *i = 0;
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use npyz::WriterBuilder as _;

    use super::*;

    fn parse(bytes: &[u8]) -> Result<Array, DataError> {
        Array::read(&mut &bytes[..], "depth", Path::new("a.npy"))
    }

    fn raw(header: &str, data: &[u8]) -> Vec<u8> {
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((header.len() as u16).to_le_bytes());
        bytes.extend(header.as_bytes());
        bytes.extend(data);
        bytes
    }

    #[test]
    fn what_npyz_writes_is_read() {
        let mut bytes = Vec::new();
        let mut writer =
            npyz::WriteOptions::new().default_dtype().shape(&[2, 3]).writer(&mut bytes).begin_nd().unwrap();
        writer.extend((0..6).map(|k| k as f32 / 4.0)).unwrap();
        writer.finish().unwrap();
        let array = parse(&bytes).unwrap().expect(&[2, 0]).unwrap();
        assert_eq!((array.shape(), array.to_f32()), (&[2, 3][..], vec![0.0, 0.25, 0.5, 0.75, 1.0, 1.25]));
        let error = parse(&bytes).unwrap().expect(&[0, 4]).unwrap_err().to_string();
        assert!(error.contains("[any, 4]") && error.contains("[2, 3]"), "{error}");
        assert!(parse(&bytes[..bytes.len() - 1]).unwrap_err().to_string().contains("23 of 24 bytes"));
    }

    #[test]
    fn orders_types_and_scalars() {
        let fortran =
            raw("{'descr': '>i2', 'fortran_order': True, 'shape': (2, 3), }", &[0, 0, 0, 3, 0, 1, 0, 4, 0, 2, 0, 5]);
        assert_eq!(parse(&fortran).unwrap().to_f64(), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
        let scalar = raw("{'descr': '|b1', 'fortran_order': False, 'shape': ()}", &[1]);
        let scalar = parse(&scalar).unwrap().expect(&[]).unwrap();
        assert_eq!(scalar.to_bools(), [true]);
        let half =
            raw("{\"descr\": \"<f2\", 'fortran_order': False, 'shape': (1,)}", &f16::from_f32(65504.0).to_le_bytes());
        assert_eq!(parse(&half).unwrap().to_f32(), [65504.0]);
    }

    #[test]
    fn files_are_not_trusted() {
        let header =
            |descr: &str, shape: &str| format!("{{'descr': {descr}, 'fortran_order': False, 'shape': {shape}}}");
        for (bytes, words) in [
            (b"PK\x03\x04....".to_vec(), "not in numpy's format"),
            (b"\x93NUM".to_vec(), "cut off"),
            (raw(&header("'<f4'", "(9223372036854775807, 4)"), &[]), "more than 4 GiB"),
            (raw(&header("'<f4'", "(1000000, 1000)"), &[0; 8]), "8 of 4000000000 bytes"),
            (raw(&header("'|O'", "(1,)"), &[0; 8]), "pickled"),
            (raw(&header("'<U5'", "(1,)"), &[0; 8]), "type <U5"),
            (raw(&header("[('x', '<f4')]", "(1,)"), &[0; 8]), "records"),
            (raw("{'descr': '<f4'}", &[]), "not understood"),
            (raw(&header("'<f4'", "(-1,)"), &[]), "not understood"),
        ] {
            let error = parse(&bytes).unwrap_err().to_string();
            assert!(error.contains(words) && error.ends_with("a.npy"), "{words}: {error}");
        }
    }
}
