//! A saved field: what trajectories are made of, as one safetensors file written and read piece by piece.
//!
//! Layout: u64 length of the header (little endian), the header (JSON, padded with spaces to a multiple of 8), the tensors back to back
//! in the order of their specs, C order, little endian, types F32, F16 or U32. `__metadata__` (strings) holds
//! `"format": "omnix-field"`, `"version": "1"` and whatever the writer was given. Any safetensors reader opens the file.
//!
//! The writer knows all shapes beforehand, so nothing is held in memory; the file has its name only when whole. The reader keeps the
//! header and reads ranges of elements, so one image's part of a tensor is read without the rest.

use std::{
    collections::BTreeMap,
    fmt::Write as _,
    fs::File,
    io::{Read, Seek, SeekFrom},
    ops::Range,
    path::{Path, PathBuf},
};

use half::f16;
use serde_json::{Map, Value, json};

use super::atomic::AtomicFile;
use crate::IoError;

/// `format` of the metadata.
pub const FIELD_FORMAT: &str = "omnix-field";
/// `version` of the metadata that is written and read.
pub const FIELD_VERSION: &str = "1";

/// A header longer than this is none; ours have a few kB.
const MAX_HEADER: u64 = 16 << 20;

/// Type of a tensor's elements.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FieldType {
    /// 32-bit float.
    F32,
    /// 16-bit float; written from and read as 32 bit.
    F16,
    /// Unsigned 32-bit integer.
    U32,
}

impl FieldType {
    fn name(self) -> &'static str {
        match self {
            Self::F32 => "F32",
            Self::F16 => "F16",
            Self::U32 => "U32",
        }
    }

    /// Bytes of an element.
    #[must_use]
    pub fn bytes(self) -> usize {
        match self {
            Self::F32 | Self::U32 => 4,
            Self::F16 => 2,
        }
    }
}

/// Name, type and shape of a tensor.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorSpec {
    /// Its name in the file.
    pub name: String,
    /// Type of its elements.
    pub dtype: FieldType,
    /// Its shape, slowest first.
    pub shape: Vec<usize>,
}

impl TensorSpec {
    /// A spec.
    #[must_use]
    pub fn new(name: impl Into<String>, dtype: FieldType, shape: impl Into<Vec<usize>>) -> Self {
        Self { name: name.into(), dtype, shape: shape.into() }
    }

    /// Number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }

    /// Whether it has no elements.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

/// Writes a saved field, tensor after tensor in the order of the specs, each in as many pieces as wanted.
pub struct FieldWriter {
    file: AtomicFile,
    path: PathBuf,
    specs: Vec<TensorSpec>,
    /// The tensor being written, and how many of its elements are.
    current: usize,
    written: usize,
}

impl FieldWriter {
    /// Starts the file with its header. `metadata` may not set `format` or `version`.
    ///
    /// # Errors
    /// Two tensors of one name; a failure of writing.
    pub fn create(path: &Path, specs: &[TensorSpec], metadata: &BTreeMap<String, String>) -> Result<Self, IoError> {
        let mut meta = Map::new();
        meta.insert("format".into(), json!(FIELD_FORMAT));
        meta.insert("version".into(), json!(FIELD_VERSION));
        for (name, value) in metadata {
            meta.entry(name.clone()).or_insert_with(|| json!(value));
        }
        let mut header = Map::new();
        header.insert("__metadata__".into(), Value::Object(meta));
        let mut at = 0;
        for spec in specs {
            let end = at + spec.len() * spec.dtype.bytes();
            let entry = json!({ "dtype": spec.dtype.name(), "shape": spec.shape, "data_offsets": [at, end] });
            if header.insert(spec.name.clone(), entry).is_some() {
                let reason = "is announced twice or has a reserved name".into();
                return Err(IoError::FieldTensor { name: spec.name.clone(), reason, path: path.to_owned() });
            }
            at = end;
        }
        let mut text = Value::Object(header).to_string().into_bytes();
        text.resize(text.len().next_multiple_of(8), b' ');
        let mut file = AtomicFile::create(path.to_owned())?;
        file.put(&(text.len() as u64).to_le_bytes())?;
        file.put(&text)?;
        Ok(Self { file, path: path.to_owned(), specs: specs.to_vec(), current: 0, written: 0 })
    }

    /// Writes the next elements of the f32 or f16 tensor `name`. f16 is rounded to nearest even.
    ///
    /// # Errors
    /// Another tensor's turn, another type or too many elements; a failure of writing.
    pub fn write(&mut self, name: &str, values: &[f32]) -> Result<(), IoError> {
        let dtype = self.advance(name, values.len(), |dtype| dtype != FieldType::U32)?;
        // In pieces, so that a large tensor is not held twice.
        for part in values.chunks(1 << 16) {
            let bytes: Vec<u8> = if dtype == FieldType::F16 {
                part.iter().flat_map(|&v| f16::from_f32(v).to_le_bytes()).collect()
            } else {
                part.iter().flat_map(|v| v.to_le_bytes()).collect()
            };
            self.file.put(&bytes)?;
        }
        Ok(())
    }

    /// Writes the next elements of the u32 tensor `name`.
    ///
    /// # Errors
    /// As [`FieldWriter::write`].
    pub fn write_u32(&mut self, name: &str, values: &[u32]) -> Result<(), IoError> {
        self.advance(name, values.len(), |dtype| dtype == FieldType::U32)?;
        for part in values.chunks(1 << 16) {
            self.file.put(&part.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>())?;
        }
        Ok(())
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// A tensor that is not whole; a failure of writing. Then there is no file.
    pub fn finish(mut self) -> Result<PathBuf, IoError> {
        self.skip_whole();
        if let Some(spec) = self.specs.get(self.current) {
            let reason = format!("has {} of {} elements when the file ends", self.written, spec.len());
            return Err(IoError::FieldTensor { name: spec.name.clone(), reason, path: self.path });
        }
        self.file.commit()
    }

    /// Moves on from tensors that are whole.
    fn skip_whole(&mut self) {
        while self.specs.get(self.current).is_some_and(|spec| self.written == spec.len()) {
            self.current += 1;
            self.written = 0;
        }
    }

    /// Checks that `count` elements of `name` come next, counts them and returns the tensor's type.
    fn advance(&mut self, name: &str, count: usize, fits: fn(FieldType) -> bool) -> Result<FieldType, IoError> {
        let refuse = |reason: String| IoError::FieldTensor { name: name.into(), reason, path: self.path.clone() };
        // An empty piece of a tensor that is whole or empty is no reason to complain.
        if count == 0
            && let Some(spec) = self.specs.iter().find(|s| s.name == name)
        {
            return Ok(spec.dtype);
        }
        let mut at = (self.current, self.written);
        while self.specs.get(at.0).is_some_and(|spec| at.1 == spec.len()) {
            at = (at.0 + 1, 0);
        }
        let Some(spec) = self.specs.get(at.0) else { return Err(refuse("comes after the last one".into())) };
        if spec.name != name {
            return Err(refuse(format!("comes when it is the turn of \"{}\"", spec.name)));
        }
        if !fits(spec.dtype) {
            return Err(refuse(format!("was announced as {}", spec.dtype.name())));
        }
        if at.1 + count > spec.len() {
            return Err(refuse(format!("has more than {} elements", spec.len())));
        }
        let dtype = spec.dtype;
        (self.current, self.written) = (at.0, at.1 + count);
        Ok(dtype)
    }
}

/// A saved field, opened and checked; elements are read when asked for.
#[derive(Debug)]
pub struct FieldReader {
    file: File,
    path: PathBuf,
    metadata: BTreeMap<String, String>,
    /// Specs in the order of the file, each with the place of its first byte.
    tensors: Vec<(TensorSpec, u64)>,
}

impl FieldReader {
    /// Opens the file and checks version, sizes and that nothing is cut off.
    ///
    /// # Errors
    /// No such file, another kind of file, another version, a file cut short, a header that contradicts itself.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        let read = |e| IoError::read(path, e);
        let not = |reason: &str| IoError::NotAField { reason: reason.into(), path: path.to_owned() };
        let mut file = File::open(path).map_err(read)?;
        let found = file.metadata().map_err(read)?.len();
        let mut length = [0; 8];
        if found < 8 {
            return Err(IoError::FieldCutShort { expected: 8, found, path: path.to_owned() });
        }
        file.read_exact(&mut length).map_err(read)?;
        let length = u64::from_le_bytes(length);
        if !(2..=MAX_HEADER).contains(&length) {
            return Err(not("its first bytes are no safetensors header"));
        }
        if found < 8 + length {
            return Err(IoError::FieldCutShort { expected: 8 + length, found, path: path.to_owned() });
        }
        let mut text = vec![0; length as usize];
        file.read_exact(&mut text).map_err(read)?;
        let header: Map<String, Value> =
            serde_json::from_slice(&text).map_err(|_syntax| not("its header is not JSON"))?;
        let metadata = metadata(&header).ok_or_else(|| not("it has no metadata of a saved field"))?;
        if metadata.get("format").map(String::as_str) != Some(FIELD_FORMAT) {
            return Err(not("its metadata does not name the format omnix-field"));
        }
        let version = metadata.get("version").cloned().unwrap_or_else(|| "(none)".into());
        if version != FIELD_VERSION {
            return Err(IoError::FieldVersion { found: version, known: FIELD_VERSION, path: path.to_owned() });
        }
        let (tensors, end) = tensors(&header, 8 + length, path)?;
        if found < end {
            return Err(IoError::FieldCutShort { expected: end, found, path: path.to_owned() });
        }
        if found > end {
            return Err(not(&format!("{} bytes follow its last tensor", found - end)));
        }
        Ok(Self { file, path: path.to_owned(), metadata, tensors })
    }

    /// A string of the metadata.
    #[must_use]
    pub fn metadata(&self, name: &str) -> Option<&str> {
        self.metadata.get(name).map(String::as_str)
    }

    /// All tensors in the order of the file.
    pub fn specs(&self) -> impl Iterator<Item = &TensorSpec> {
        self.tensors.iter().map(|(spec, _)| spec)
    }

    /// Type and shape of a tensor.
    ///
    /// # Errors
    /// No tensor of that name.
    pub fn spec(&self, name: &str) -> Result<&TensorSpec, IoError> {
        self.find(name).map(|(spec, _)| spec)
    }

    /// An error unless the tensor has this shape.
    ///
    /// # Errors
    /// No tensor of that name, or of another shape.
    pub fn expect_shape(&self, name: &str, shape: &[usize]) -> Result<(), IoError> {
        let found = &self.spec(name)?.shape;
        if found == shape { Ok(()) } else { Err(self.refuse(name, format!("is {found:?} instead of {shape:?}"))) }
    }

    /// Elements of an f32 or f16 tensor, counted in C order.
    ///
    /// # Errors
    /// No such tensor, elements outside it, a tensor of integers; a failure of reading.
    pub fn read(&mut self, name: &str, elements: Range<usize>) -> Result<Vec<f32>, IoError> {
        let dtype = self.spec(name)?.dtype;
        if dtype == FieldType::U32 {
            return Err(self.refuse(name, "holds integers where numbers are wanted".into()));
        }
        let bytes = self.bytes(name, elements)?;
        Ok(if dtype == FieldType::F16 {
            bytes.as_chunks().0.iter().map(|b| f16::from_le_bytes(*b).to_f32()).collect()
        } else {
            bytes.as_chunks().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
        })
    }

    /// Elements of a u32 tensor, counted in C order.
    ///
    /// # Errors
    /// No such tensor, elements outside it, a tensor of floats; a failure of reading.
    pub fn read_u32(&mut self, name: &str, elements: Range<usize>) -> Result<Vec<u32>, IoError> {
        if self.spec(name)?.dtype != FieldType::U32 {
            return Err(self.refuse(name, "holds floats where integers are wanted".into()));
        }
        let bytes = self.bytes(name, elements)?;
        Ok(bytes.as_chunks().0.iter().map(|b| u32::from_le_bytes(*b)).collect())
    }

    fn bytes(&mut self, name: &str, elements: Range<usize>) -> Result<Vec<u8>, IoError> {
        let (spec, start) = self.find(name)?;
        if elements.start > elements.end || elements.end > spec.len() {
            let mut reason = format!("has {} elements", spec.len());
            let _ = write!(reason, ", not {}..{}", elements.start, elements.end);
            return Err(self.refuse(name, reason));
        }
        let size = spec.dtype.bytes();
        let at = start + (elements.start * size) as u64;
        let mut bytes = vec![0; elements.len() * size];
        let read = self.file.seek(SeekFrom::Start(at)).and_then(|_| self.file.read_exact(&mut bytes));
        read.map_err(|e| IoError::read(&self.path, e))?;
        Ok(bytes)
    }

    fn find(&self, name: &str) -> Result<(&TensorSpec, u64), IoError> {
        let found = self.tensors.iter().find(|(spec, _)| spec.name == name);
        found.map(|(spec, at)| (spec, *at)).ok_or_else(|| self.refuse(name, "is missing".into()))
    }

    fn refuse(&self, name: &str, reason: String) -> IoError {
        IoError::FieldTensor { name: name.into(), reason, path: self.path.clone() }
    }
}

fn metadata(header: &Map<String, Value>) -> Option<BTreeMap<String, String>> {
    let meta = header.get("__metadata__")?.as_object()?;
    meta.iter().map(|(name, value)| Some((name.clone(), value.as_str()?.to_owned()))).collect()
}

/// The tensors in the order of their bytes, and where the last one ends. `start` is the place of the first byte.
fn tensors(header: &Map<String, Value>, start: u64, path: &Path) -> Result<(Vec<(TensorSpec, u64)>, u64), IoError> {
    let mut found = Vec::new();
    for (name, entry) in header.iter().filter(|(name, _)| *name != "__metadata__") {
        let refuse =
            |reason: &str| IoError::FieldTensor { name: name.clone(), reason: reason.into(), path: path.to_owned() };
        let dtype = [FieldType::F32, FieldType::F16, FieldType::U32].into_iter().find(|t| entry["dtype"] == t.name());
        let dtype = dtype.ok_or_else(|| refuse("is neither F32 nor F16 nor U32"))?;
        let numbers = |value: &Value| -> Option<Vec<u64>> { value.as_array()?.iter().map(Value::as_u64).collect() };
        let shape = numbers(&entry["shape"]).ok_or_else(|| refuse("has no shape"))?;
        let offsets = numbers(&entry["data_offsets"]).unwrap_or_default();
        let &[from, to] = offsets.as_slice() else { return Err(refuse("has no place in the file")) };
        let size = shape.iter().try_fold(dtype.bytes() as u64, |size, &n| size.checked_mul(n));
        if to.checked_sub(from) != size || size.is_none() {
            return Err(refuse("has another number of bytes than its shape says"));
        }
        let shape = shape.iter().map(|&n| n as usize).collect::<Vec<_>>();
        found.push((TensorSpec { name: name.clone(), dtype, shape }, from, to));
    }
    found.sort_by_key(|(_, from, to)| (*from, *to));
    let mut end = 0;
    for (spec, from, to) in &found {
        if *from != end {
            let reason = "overlaps another or leaves a gap".into();
            return Err(IoError::FieldTensor { name: spec.name.clone(), reason, path: path.to_owned() });
        }
        end = *to;
    }
    let end = end.saturating_add(start);
    Ok((found.into_iter().map(|(spec, from, _)| (spec, start + from)).collect(), end))
}
