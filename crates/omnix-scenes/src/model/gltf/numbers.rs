//! The numbers of a glTF file: its buffers, and accessors into them. No length that the file states is believed.

use gltf::accessor::{DataType, Dimensions};
use gltf::{Accessor, Gltf, buffer};

use crate::assets::store::Store;
use crate::model::flaw::Flaw;

/// All buffers of a file together have fewer bytes than this.
const MOST_BYTES: u64 = 256 << 20;
/// An accessor has fewer numbers than this: the positions of three million corners.
const MOST_NUMBERS: usize = 12 << 20;

/// The buffers of a file, read.
pub(super) struct Buffers(Vec<Vec<u8>>);

impl Buffers {
    pub(super) fn read(file: &Gltf, store: &Store, name: &str) -> Result<Self, Flaw> {
        let (mut all, mut left) = (Vec::new(), MOST_BYTES);
        for buffer in file.buffers() {
            let bytes = match buffer.source() {
                buffer::Source::Bin => file.blob.clone().ok_or(Flaw::Index("a buffer"))?,
                buffer::Source::Uri(uri) => resource(uri, store, name, left)?,
            };
            left = left.checked_sub(bytes.len() as u64).ok_or(Flaw::Bytes { most: MOST_BYTES })?;
            all.push(bytes);
        }
        Ok(Self(all))
    }

    /// The bytes of a view.
    pub(super) fn view(&self, view: &buffer::View) -> Result<&[u8], Flaw> {
        let end = view.offset().checked_add(view.length());
        let bytes = self.0.get(view.buffer().index());
        end.and_then(|end| bytes?.get(view.offset()..end)).ok_or(Flaw::Index("a view of a buffer"))
    }

    /// The numbers of an accessor, `N` for each entry; integers that stand for [0, 1] or [-1, 1] are turned into that.
    pub(super) fn numbers<const N: usize>(&self, accessor: &Accessor) -> Result<Vec<[f64; N]>, Flaw> {
        let width = match accessor.dimensions() {
            Dimensions::Scalar => 1,
            Dimensions::Vec2 => 2,
            Dimensions::Vec3 => 3,
            Dimensions::Vec4 | Dimensions::Mat2 => 4,
            Dimensions::Mat3 => 9,
            Dimensions::Mat4 => 16,
        };
        if width != N {
            return Err(Flaw::Broken(format!("an accessor has entries of {width} numbers, not of {N}")));
        }
        let count = accessor.count();
        if count.saturating_mul(N) > MOST_NUMBERS {
            return Err(Flaw::Broken(format!("an accessor has {count} entries")));
        }
        let kind = accessor.data_type();
        let one = |bytes: &[u8]| {
            let number = number(kind, bytes);
            if accessor.normalized() { (number / largest(kind)).max(-1.0) } else { number }
        };
        let read = |bytes: &[u8]| -> [f64; N] {
            let size = kind.size();
            std::array::from_fn(|k| one(&bytes[k * size..(k + 1) * size]))
        };
        let mut all = match accessor.view() {
            Some(view) => {
                let stride = view.stride().unwrap_or(N * kind.size());
                entries(self.view(&view)?, accessor.offset(), stride, N * kind.size(), count)?.map(read).collect()
            }
            None => vec![[0.0; N]; count],
        };
        if let Some(sparse) = accessor.sparse() {
            let (indices, values) = (sparse.indices(), sparse.values());
            let kind = match indices.index_type() {
                gltf::accessor::sparse::IndexType::U8 => DataType::U8,
                gltf::accessor::sparse::IndexType::U16 => DataType::U16,
                gltf::accessor::sparse::IndexType::U32 => DataType::U32,
            };
            let size = kind.size();
            let places = entries(self.view(&indices.view())?, indices.offset(), size, size, sparse.count())?;
            let size = N * accessor.data_type().size();
            let values = entries(self.view(&values.view())?, values.offset(), size, size, sparse.count())?;
            for (place, value) in places.zip(values) {
                let place = number(kind, place) as usize;
                *all.get_mut(place).ok_or(Flaw::Index("an entry of an accessor"))? = read(value);
            }
        }
        Ok(all)
    }
}

/// `count` pieces of `size` bytes, `stride` bytes apart.
fn entries(
    bytes: &[u8],
    offset: usize,
    stride: usize,
    size: usize,
    count: usize,
) -> Result<impl Iterator<Item = &[u8]>, Flaw> {
    let last = count.saturating_sub(1).checked_mul(stride).and_then(|last| last.checked_add(offset)?.checked_add(size));
    let fits = count == 0 || last.is_some_and(|last| last <= bytes.len());
    if !fits || stride < size {
        return Err(Flaw::Index("an accessor"));
    }
    Ok((0..count).map(move |k| &bytes[offset + k * stride..offset + k * stride + size]))
}

fn largest(kind: DataType) -> f64 {
    match kind {
        DataType::I8 => 127.0,
        DataType::U8 => 255.0,
        DataType::I16 => 32767.0,
        DataType::U16 => 65535.0,
        DataType::U32 => 4_294_967_295.0,
        DataType::F32 => 1.0,
    }
}

/// A number of as many bytes as its kind has.
fn number(kind: DataType, bytes: &[u8]) -> f64 {
    let two = || [bytes[0], bytes[1]];
    let four = || [bytes[0], bytes[1], bytes[2], bytes[3]];
    match kind {
        DataType::I8 => f64::from(bytes[0] as i8),
        DataType::U8 => f64::from(bytes[0]),
        DataType::I16 => f64::from(i16::from_le_bytes(two())),
        DataType::U16 => f64::from(u16::from_le_bytes(two())),
        DataType::U32 => f64::from(u32::from_le_bytes(four())),
        DataType::F32 => f64::from(f32::from_le_bytes(four())),
    }
}

/// The bytes of a URI: base64 in place, or a file beside the model.
pub(super) fn resource(uri: &str, store: &Store, name: &str, most: u64) -> Result<Vec<u8>, Flaw> {
    if let Some(data) = uri.strip_prefix("data:") {
        let (_, text) =
            data.split_once(";base64,").ok_or_else(|| Flaw::Unsupported("data that is not base64".to_owned()))?;
        return base64(text).ok_or_else(|| Flaw::Broken("its base64 is damaged".to_owned()));
    }
    let file = store.find(name, &unescaped(uri)).ok_or_else(|| Flaw::Broken(format!("{uri} is missing")))?;
    store.read(file, most)
}

/// `%20` and the like as what they stand for.
fn unescaped(uri: &str) -> String {
    let (bytes, mut out, mut k) = (uri.as_bytes(), Vec::new(), 0);
    while k < bytes.len() {
        let code = bytes.get(k + 1..k + 3).and_then(|hex| u8::from_str_radix(std::str::from_utf8(hex).ok()?, 16).ok());
        match code {
            Some(byte) if bytes[k] == b'%' => {
                out.push(byte);
                k += 3;
            }
            _ => {
                out.push(bytes[k]);
                k += 1;
            }
        }
    }
    String::from_utf8_lossy(&out).into_owned()
}

fn base64(text: &str) -> Option<Vec<u8>> {
    let (mut out, mut bits, mut held) = (Vec::with_capacity(text.len() / 4 * 3), 0_u32, 0);
    for byte in text.bytes().take_while(|&byte| byte != b'=') {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' => 62,
            b'/' => 63,
            _ => return None,
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
        }
    }
    Some(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uris_are_decoded() {
        assert_eq!(base64("aGVsbG8gdGhlcmU=").unwrap(), b"hello there");
        assert_eq!(base64("aG*"), None);
        assert_eq!(unescaped("a%20chair%2.png%"), "a chair%2.png%");
    }

    #[test]
    fn entries_stay_inside() {
        let bytes = [0_u8, 1, 2, 3, 4, 5, 6, 7];
        let all: Vec<&[u8]> = entries(&bytes, 1, 3, 1, 3).unwrap().collect();
        assert_eq!(all, [&[1], &[4], &[7]]);
        for (offset, stride, size, count) in [(2, 3, 1, 3), (0, 2, 3, 1), (0, 1, 1, usize::MAX), (9, 1, 1, 1)] {
            assert!(entries(&bytes, offset, stride, size, count).is_err(), "{offset} {stride} {size} {count}");
        }
        assert_eq!(entries(&bytes, 0, 1, 1, 0).unwrap().count(), 0);
    }
}
