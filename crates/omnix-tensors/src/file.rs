//! One file of tensors, of safetensors or of PyTorch: its header and its bytes. Knows neither a configuration nor prefixes.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::convert::{self, Findings};
use crate::header;
use crate::info::{Header, TensorInfo};
use crate::mapping::Bytes;
use crate::view::TensorView;
use crate::{Dtype, Float, TensorError, pytorch};

/// A safetensors file or a checkpoint of PyTorch, mapped or in memory. Tensors are found by their full names.
#[derive(Debug)]
pub struct TensorFile {
    bytes: Bytes,
    header: Header,
    /// Tensors that do not lie in order in the file; their ranges begin where the file ends.
    ordered: Vec<u8>,
    path: PathBuf,
}

impl TensorFile {
    /// Maps a file and reads its header. Do not shorten the file while it is open: the system then ends the process at the next
    /// access. Replacing it by renaming another over it is harmless.
    ///
    /// # Errors
    /// When the file is absent, unreadable, neither safetensors nor a checkpoint of PyTorch, or of another length than it says.
    pub fn open(path: &Path) -> Result<Self, TensorError> {
        Self::new(Bytes::map(path)?, path)
    }

    /// Reads bytes that are already in memory; `label` stands for the path in messages.
    ///
    /// # Errors
    /// As [`TensorFile::open`].
    pub fn from_bytes(bytes: Cow<'static, [u8]>, label: &str) -> Result<Self, TensorError> {
        Self::new(Bytes::Memory(bytes), Path::new(label))
    }

    fn new(bytes: Bytes, path: &Path) -> Result<Self, TensorError> {
        if pytorch::is_archive(&bytes) {
            let pytorch::Checkpoint { header, ordered } = pytorch::read(&bytes, path)?;
            return Ok(Self { bytes, header, ordered, path: path.to_owned() });
        }
        let total = bytes.len() as u64;
        let length = header::length(&bytes[..bytes.len().min(header::START)], total, path)?;
        let header = header::parse(&bytes[8..8 + length], total, path)?;
        Ok(Self { bytes, header, ordered: Vec::new(), path: path.to_owned() })
    }

    /// The tensors by full name, in the order of their names.
    pub fn tensors(&self) -> impl ExactSizeIterator<Item = (&str, &TensorInfo)> {
        self.header.tensors.iter().map(|(name, info)| (name.as_str(), info))
    }

    /// What the header says of a tensor.
    #[must_use]
    pub fn info(&self, name: &str) -> Option<&TensorInfo> {
        self.header.tensors.get(name)
    }

    /// The file's `__metadata__`.
    #[must_use]
    pub fn metadata(&self) -> &BTreeMap<String, String> {
        &self.header.metadata
    }

    /// A tensor by its full name.
    ///
    /// # Errors
    /// When there is no such tensor, or its elements are not F32, F16, BF16 or F64.
    pub fn tensor(&self, name: &str) -> Result<TensorView<'_>, TensorError> {
        let missing = || TensorError::Missing { tensor: name.to_owned(), path: self.path.clone() };
        let info = self.info(name).ok_or_else(missing)?;
        let dtype = info.known().and_then(Dtype::float).ok_or_else(|| TensorError::WrongType {
            tensor: name.to_owned(),
            dtype: info.dtype.clone(),
            wanted: "F32, F16, BF16 or F64",
            path: self.path.clone(),
        })?;
        Ok(TensorView { shape: &info.shape, dtype, bytes: self.at(info.range.clone()) })
    }

    /// The bytes of a tensor of any type, as stored.
    #[must_use]
    pub fn tensor_bytes(&self, name: &str) -> Option<&[u8]> {
        self.info(name).map(|info| self.at(info.range.clone()))
    }

    /// Gives back the memory that reading a tensor took, where the file is mapped; a later access reads the file again.
    pub fn release(&self, name: &str) {
        if let Some(info) = self.info(name).filter(|info| info.range.end <= self.bytes.len()) {
            self.bytes.release(info.range.clone());
        }
    }

    /// Bytes of the file, or beyond its end those that were put in order.
    fn at(&self, range: Range<usize>) -> &[u8] {
        match range.start.checked_sub(self.bytes.len()) {
            Some(start) if !self.ordered.is_empty() => &self.ordered[start..][..range.len()],
            _ => &self.bytes[range],
        }
    }

    /// The whole file in pieces of its bytes in order, with the parts of tensors that lie in each. No element is cut, and what a
    /// piece took in memory is given back when it is done, so that the file is read once and never lies in memory whole. Tensors that
    /// were put in order come last, in pieces without bytes of the file.
    ///
    /// # Errors
    /// What `each` breaks off with.
    pub fn in_pieces<B>(&self, each: &mut dyn FnMut(&Piece<'_>) -> ControlFlow<B>) -> ControlFlow<B> {
        let total = self.bytes.len();
        for (range, parts) in pieces(&self.header, total, total + self.ordered.len()) {
            let numbers = self.at(range.clone());
            let in_file = range.start < total;
            each(&Piece { bytes: if in_file { numbers } else { &[] }, numbers, start: range.start, parts })?;
            if in_file {
                self.bytes.release(range);
            }
        }
        ControlFlow::Continue(())
    }

    /// Bytes of the file.
    #[must_use]
    pub fn byte_len(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Where the file lies, or the label of bytes in memory.
    #[must_use]
    pub fn path(&self) -> &Path {
        &self.path
    }
}

/// Bytes of a piece at most, unless an element alone is more.
const PIECE: usize = 16 << 20;

/// Neighbouring bytes of a file, or of tensors that were put in order.
#[derive(Debug)]
pub struct Piece<'a> {
    /// Those of the file; none of tensors that were put in order.
    pub bytes: &'a [u8],
    /// Those that the parts lie in.
    numbers: &'a [u8],
    /// Where they begin.
    start: usize,
    parts: Vec<Part<'a>>,
}

/// Neighbouring elements of one tensor.
#[derive(Debug)]
struct Part<'a> {
    name: &'a str,
    info: &'a TensorInfo,
    range: Range<usize>,
}

impl Piece<'_> {
    /// What keeps numbers in this piece from being used, tensor by tensor, with places counted in the whole tensor. Tensors of other
    /// types than floats are left out. Works on all processors.
    #[must_use]
    pub fn examine(&self) -> Vec<(&str, Findings)> {
        // Tensors are small or large: cut so that processors have equal shares.
        const SHARE: usize = 256 << 10;
        let floats = self.parts.iter().filter_map(|part| Some((part, part.info.known().and_then(Dtype::float)?)));
        let shares: Vec<_> = floats
            .flat_map(|(part, dtype)| part.range.clone().step_by(SHARE).map(move |start| (part, dtype, start)))
            .collect();
        let examine = |&(part, dtype, start): &(&Part<'_>, Float, usize)| {
            let range = start..part.range.end.min(start + SHARE);
            let before = (start - part.info.range.start) / dtype.size();
            let found = convert::examine(dtype, &self.numbers[range.start - self.start..range.end - self.start]);
            Findings::default().and(before, found)
        };
        let found: Vec<Findings> = shares.par_iter().map(examine).collect();
        shares
            .iter()
            .zip(found)
            .filter(|(_, found)| *found != Findings::default())
            .map(|((part, ..), found)| (part.name, found))
            .collect()
    }
}

/// Cuts a file of `total` bytes, and what lies behind it up to `end`, into pieces. Bytes that belong to no tensor, such as those of a
/// header, are part of them.
fn pieces(header: &Header, total: usize, end: usize) -> Vec<(Range<usize>, Vec<Part<'_>>)> {
    let mut cutter = Cutter { total, done: Vec::new(), range: 0..0, parts: Vec::new() };
    for (name, info) in header.in_file_order() {
        cutter.add(info.range.start, 1, None);
        cutter.add(info.range.end, info.known().map_or(1, Dtype::size), Some((name, info)));
    }
    cutter.add(end, 1, None);
    cutter.cut();
    cutter.done
}

/// Pieces that are done, and the one that is being filled.
struct Cutter<'a> {
    total: usize,
    done: Vec<(Range<usize>, Vec<Part<'a>>)>,
    range: Range<usize>,
    parts: Vec<Part<'a>>,
}

impl<'a> Cutter<'a> {
    /// Adds the bytes up to `to`, which consist of elements of `size` bytes.
    fn add(&mut self, to: usize, size: usize, tensor: Option<(&'a str, &'a TensorInfo)>) {
        while self.range.end < to {
            let room = PIECE.saturating_sub(self.range.len()) / size * size;
            // No piece goes on behind the end of the file.
            if room == 0 || (self.range.end == self.total && self.range.start < self.total) {
                self.cut();
                continue;
            }
            let range = self.range.end..to.min(self.range.end + room);
            self.range.end = range.end;
            self.parts.extend(tensor.map(|(name, info)| Part { name, info, range }));
        }
    }

    fn cut(&mut self) {
        if !self.range.is_empty() {
            let next = self.range.end..self.range.end;
            self.done.push((std::mem::replace(&mut self.range, next), std::mem::take(&mut self.parts)));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A file of an F32 tensor, 3 bytes, and an F64 tensor, so that the last is not aligned.
    fn file(floats: usize, doubles: usize) -> TensorFile {
        let (a, b) = (4 * floats, 4 * floats + 3);
        let header = format!(
            r#"{{"a":{{"dtype":"F32","shape":[{floats}],"data_offsets":[0,{a}]}},"b":{{"dtype":"U8","shape":[3],"data_offsets":[{a},{b}]}},"c":{{"dtype":"F64","shape":[{doubles}],"data_offsets":[{b},{}]}}}}"#,
            b + 8 * doubles
        );
        let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
        bytes.extend(header.as_bytes());
        bytes.extend((0..floats).flat_map(|i| (i as f32 % 100.0).to_le_bytes()));
        bytes.extend([1, 2, 3]);
        bytes.extend((0..doubles).flat_map(|i| (i as f64 % 100.0).to_le_bytes()));
        // The last of each float, and one in the middle.
        let end = bytes.len();
        bytes[end - 8..].copy_from_slice(&f64::NAN.to_le_bytes());
        let data = 8 + header.len();
        bytes[data + a - 4..data + a].copy_from_slice(&1e6f32.to_le_bytes());
        bytes[data + a - 8..data + a - 4].copy_from_slice(&f32::INFINITY.to_le_bytes());
        TensorFile::from_bytes(bytes.into(), "test").unwrap()
    }

    #[test]
    fn pieces_are_the_file_and_cut_no_element() {
        for (floats, doubles) in [(3, 1), (5 << 20, 3 << 20), (4 << 20, 2 << 20)] {
            let file = file(floats, doubles);
            let (mut together, mut found) = (Vec::new(), Vec::new());
            let whole = file.in_pieces(&mut |piece| -> ControlFlow<()> {
                assert!(piece.bytes.len() <= PIECE);
                together.extend_from_slice(piece.bytes);
                found.extend(piece.examine().into_iter().map(|(name, found)| (name.to_owned(), found)));
                ControlFlow::Continue(())
            });
            assert!(whole.is_continue() && together == *file.bytes, "{floats} {doubles}");
            let all = |name: &str| {
                found
                    .iter()
                    .filter(|(of, _)| of == name)
                    .fold(Findings::default(), |all, (_, found)| all.and(0, *found))
            };
            let a = Findings { non_finite: Some((floats - 2, f32::INFINITY)), beyond_f16: Some((floats - 1, 1e6)) };
            assert_eq!(all("a"), a);
            let c = all("c");
            assert!(c.non_finite.is_some_and(|(at, v)| at == doubles - 1 && v.is_nan()) && c.beyond_f16.is_none());
            assert_eq!(all("b"), Findings::default());
        }
    }

    #[test]
    fn breaking_off_ends_it() {
        let file = file(9 << 20, 1);
        let mut pieces = 0;
        let broken = file.in_pieces(&mut |_| {
            pieces += 1;
            if pieces == 2 { ControlFlow::Break(7) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((broken, pieces), (ControlFlow::Break(7), 2));
    }
}
