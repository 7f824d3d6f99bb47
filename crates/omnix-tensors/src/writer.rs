//! A safetensors file written piece by piece: names, types and shapes are known beforehand, so nothing is held in memory, and the
//! file has its name only when it is whole.
//!
//! Layout: u64 length of the header (little endian), the header (JSON, padded with spaces to a multiple of 8), the tensors back to
//! back in the order of their specs, row-major, little endian. Any safetensors reader opens it.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde_json::{Map, Value, json};

use crate::atomic::AtomicFile;
use crate::{Dtype, Float, TensorError, convert};

/// Name, type and shape of a tensor to be written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TensorSpec {
    /// Its name in the file.
    pub name: String,
    /// Type of its elements.
    pub dtype: Dtype,
    /// Its shape, slowest first.
    pub shape: Vec<usize>,
}

impl TensorSpec {
    /// A spec.
    #[must_use]
    pub fn new(name: impl Into<String>, dtype: Dtype, shape: impl Into<Vec<usize>>) -> Self {
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

    /// Bytes in the file, unless that is more than can be counted.
    fn bytes(&self) -> Option<usize> {
        self.shape.iter().try_fold(self.dtype.size(), |bytes, n| bytes.checked_mul(*n))
    }
}

/// Writes tensor after tensor in the order of the specs, each in as many pieces as wanted. Dropped before
/// [`TensorWriter::finish`], it leaves nothing.
pub struct TensorWriter {
    file: AtomicFile,
    path: PathBuf,
    specs: Vec<TensorSpec>,
    /// The tensor being written, and the number of its elements that are.
    current: usize,
    written: usize,
}

/// Elements converted at a time, so that a large tensor is not held twice.
const PIECE: usize = 1 << 16;

impl TensorWriter {
    /// Starts the file with its header, in a folder that is made if it is not there.
    ///
    /// # Errors
    /// Two tensors of one name, a reserved name or an impossible size; a failure of writing.
    pub fn create(path: &Path, specs: &[TensorSpec], metadata: &BTreeMap<String, String>) -> Result<Self, TensorError> {
        let text = header(path, specs, metadata)?;
        let failed = |e| TensorError::io("write the file", path, e);
        let mut file = AtomicFile::create(path).map_err(failed)?;
        file.write_all(&(text.len() as u64).to_le_bytes()).and_then(|()| file.write_all(&text)).map_err(failed)?;
        Ok(Self { file, path: path.to_owned(), specs: specs.to_vec(), current: 0, written: 0 })
    }

    /// Writes the next elements of a floating-point tensor, rounded to nearest, ties to even.
    ///
    /// # Errors
    /// [`TensorError::DoesNotFit`] for a number that is finite and too large for the tensor's type; another tensor's turn, another
    /// type or too many elements; a failure of writing.
    pub fn write_f32(&mut self, name: &str, values: &[f32]) -> Result<(), TensorError> {
        let (dtype, mut at) = self.advance(name, values.len(), |dtype| dtype.float().is_some())?;
        let Some(float) = dtype.float() else { return Ok(()) };
        let mut bytes = Vec::new();
        for part in values.chunks(PIECE) {
            bytes.clear();
            convert::from_f32(float, part, &mut bytes).map_err(|(index, value)| TensorError::DoesNotFit {
                tensor: name.to_owned(),
                index: at + index,
                value,
                dtype: dtype.name(),
                wider: Float::F32.dtype().name(),
                path: self.path.clone(),
            })?;
            self.put(&bytes)?;
            at += part.len();
        }
        Ok(())
    }

    /// Writes the next elements of an F64 tensor.
    ///
    /// # Errors
    /// Another tensor's turn, another type or too many elements; a failure of writing.
    pub fn write_f64(&mut self, name: &str, values: &[f64]) -> Result<(), TensorError> {
        self.advance(name, values.len(), |dtype| dtype == Dtype::F64)?;
        self.put_all(values, |v| v.to_le_bytes())
    }

    /// Writes the next elements of a U32 tensor.
    ///
    /// # Errors
    /// As [`TensorWriter::write_f64`].
    pub fn write_u32(&mut self, name: &str, values: &[u32]) -> Result<(), TensorError> {
        self.advance(name, values.len(), |dtype| dtype == Dtype::U32)?;
        self.put_all(values, |v| v.to_le_bytes())
    }

    /// Writes the next elements of a tensor of any type, as they lie in the file: little endian, whole elements.
    ///
    /// # Errors
    /// As [`TensorWriter::write_f64`]; bytes that are no whole number of elements.
    pub fn write_bytes(&mut self, name: &str, bytes: &[u8]) -> Result<(), TensorError> {
        let size = self.specs.iter().find(|s| s.name == name).map_or(1, |s| s.dtype.size());
        if !bytes.len().is_multiple_of(size) {
            return Err(self.refuse(name, format!("is given {} bytes, where an element has {size}", bytes.len())));
        }
        self.advance(name, bytes.len() / size, |_| true)?;
        self.put(bytes)
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// A tensor that is not whole; a failure of writing. Then there is no file.
    pub fn finish(self) -> Result<PathBuf, TensorError> {
        let (current, written) = self.place();
        if let Some(spec) = self.specs.get(current) {
            let reason = format!("has {written} of {} elements when the file ends", spec.len());
            return Err(self.refuse(&spec.name, reason));
        }
        let path = self.path;
        self.file.commit().map_err(|e| TensorError::io("write the file", &path, e))
    }

    /// The tensor whose next elements are due, past those that are whole, and the number of its elements that are written.
    fn place(&self) -> (usize, usize) {
        let mut at = (self.current, self.written);
        while self.specs.get(at.0).is_some_and(|spec| at.1 == spec.len()) {
            at = (at.0 + 1, 0);
        }
        at
    }

    /// Checks that `count` elements of `name` come next, and counts them; the tensor's type, and the first element's index.
    fn advance(&mut self, name: &str, count: usize, fits: fn(Dtype) -> bool) -> Result<(Dtype, usize), TensorError> {
        // An empty piece of a tensor that is whole or empty is no reason to complain.
        if count == 0
            && let Some(spec) = self.specs.iter().find(|s| s.name == name)
        {
            return Ok((spec.dtype, 0));
        }
        let (current, written) = self.place();
        let Some(spec) = self.specs.get(current) else {
            return Err(self.refuse(name, "comes after the last one".to_owned()));
        };
        if spec.name != name {
            return Err(self.refuse(name, format!("comes when it is the turn of \"{}\"", spec.name)));
        }
        if !fits(spec.dtype) {
            return Err(self.refuse(name, format!("was announced as {}", spec.dtype)));
        }
        if count > spec.len() - written {
            return Err(self.refuse(name, format!("has more than {} elements", spec.len())));
        }
        let dtype = spec.dtype;
        (self.current, self.written) = (current, written + count);
        Ok((dtype, written))
    }

    fn put_all<T: Copy, const N: usize>(&mut self, values: &[T], bytes: fn(T) -> [u8; N]) -> Result<(), TensorError> {
        values.chunks(PIECE).try_for_each(|part| self.put(&part.iter().flat_map(|v| bytes(*v)).collect::<Vec<u8>>()))
    }

    fn put(&mut self, bytes: &[u8]) -> Result<(), TensorError> {
        self.file.write_all(bytes).map_err(|e| TensorError::io("write the file", &self.path, e))
    }

    fn refuse(&self, name: &str, reason: String) -> TensorError {
        TensorError::OutOfTurn { tensor: name.to_owned(), reason, path: self.path.clone() }
    }
}

/// The header's text, padded.
fn header(path: &Path, specs: &[TensorSpec], metadata: &BTreeMap<String, String>) -> Result<Vec<u8>, TensorError> {
    let mut header = Map::new();
    if !metadata.is_empty() {
        header.insert("__metadata__".to_owned(), json!(metadata));
    }
    let (mut at, mut names) = (0usize, BTreeSet::from(["__metadata__"]));
    for spec in specs {
        let refuse = |reason: &str| TensorError::OutOfTurn {
            tensor: spec.name.clone(),
            reason: reason.to_owned(),
            path: path.to_owned(),
        };
        if !names.insert(&spec.name) {
            return Err(refuse("is announced twice or has a reserved name"));
        }
        let end =
            spec.bytes().and_then(|bytes| at.checked_add(bytes)).ok_or_else(|| refuse("is larger than any file"))?;
        let entry = json!({ "dtype": spec.dtype.name(), "shape": spec.shape, "data_offsets": [at, end] });
        header.insert(spec.name.clone(), entry);
        at = end;
    }
    let mut text = Value::Object(header).to_string().into_bytes();
    text.resize(text.len().next_multiple_of(8), b' ');
    Ok(text)
}
