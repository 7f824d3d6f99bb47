//! A saved field: what trajectories are made of, as one safetensors file written and read piece by piece (`omnix-tensors`).
//!
//! `__metadata__` (strings) holds `"format": "omnix-field"`, `"version": "2"` and whatever the writer was given; types are F32, F16,
//! F64 and U32. Files of version 1, whose `seconds` are F32, are read too. Any safetensors reader opens the file.
//!
//! The writer knows all shapes beforehand, so nothing is held in memory; the file has its name only when whole. The reader keeps the
//! header and reads ranges of elements or scattered rows, so that one pixel is read without the rest of its image.

use std::{
    collections::BTreeMap,
    ops::Range,
    path::{Path, PathBuf},
};

pub use omnix_tensors::{Dtype, TensorSpec};
use omnix_tensors::{TensorError, TensorReader, TensorWriter};

use crate::IoError;

/// `format` of the metadata.
pub const FIELD_FORMAT: &str = "omnix-field";
/// `version` of the metadata that is written.
pub const FIELD_VERSION: &str = "2";
/// Versions that are read.
const READ: [&str; 2] = ["1", FIELD_VERSION];
/// The same for messages.
const READ_NAMES: &str = "1 or 2";
/// Types of elements.
const TYPES: [Dtype; 4] = [Dtype::F32, Dtype::F16, Dtype::F64, Dtype::U32];

/// Writes a saved field, tensor after tensor in the order of the specs, each in as many pieces as wanted.
pub struct FieldWriter(TensorWriter);

impl FieldWriter {
    /// Starts the file with its header. `metadata` cannot set `format` or `version`.
    ///
    /// # Errors
    /// Two tensors of one name; a failure of writing.
    pub fn create(path: &Path, specs: &[TensorSpec], metadata: &BTreeMap<String, String>) -> Result<Self, IoError> {
        let mut all = metadata.clone();
        all.insert("format".to_owned(), FIELD_FORMAT.to_owned());
        all.insert("version".to_owned(), FIELD_VERSION.to_owned());
        TensorWriter::create(path, specs, &all).map(Self).map_err(writing)
    }

    /// Writes the next elements of the tensor `name` of floats. f16 is rounded to nearest even.
    ///
    /// # Errors
    /// [`IoError::FieldDoesNotFit`] for a finite number beyond f16; another tensor's turn, another type or too many elements; a
    /// failure of writing.
    pub fn write(&mut self, name: &str, values: &[f32]) -> Result<(), IoError> {
        self.0.write_f32(name, values).map_err(writing)
    }

    /// Writes the next elements of the F64 tensor `name`.
    ///
    /// # Errors
    /// Another tensor's turn, another type or too many elements; a failure of writing.
    pub fn write_f64(&mut self, name: &str, values: &[f64]) -> Result<(), IoError> {
        self.0.write_f64(name, values).map_err(writing)
    }

    /// Writes the next elements of the u32 tensor `name`.
    ///
    /// # Errors
    /// As [`FieldWriter::write_f64`].
    pub fn write_u32(&mut self, name: &str, values: &[u32]) -> Result<(), IoError> {
        self.0.write_u32(name, values).map_err(writing)
    }

    /// Completes the file and gives it its name.
    ///
    /// # Errors
    /// A tensor that is not whole; a failure of writing. Then there is no file.
    pub fn finish(self) -> Result<PathBuf, IoError> {
        self.0.finish().map_err(writing)
    }
}

/// A saved field, opened and checked; elements are read when asked for.
#[derive(Debug)]
pub struct FieldReader(TensorReader);

impl FieldReader {
    /// Opens the file and checks version, sizes, types and that nothing is cut off.
    ///
    /// # Errors
    /// No such file, another kind of file, another version, a file cut short, a header that contradicts itself.
    pub fn open(path: &Path) -> Result<Self, IoError> {
        let not = |reason: &str| IoError::NotAField { reason: reason.into(), path: path.to_owned() };
        let reader = TensorReader::open(path).map_err(|error| match std::fs::metadata(path) {
            // What is left of a field that was cut, rather than something else.
            Ok(meta) if meta.is_file() && meta.len() < 8 => {
                IoError::FieldCutShort { expected: 8, found: meta.len(), path: path.to_owned() }
            }
            _ => reading(error),
        })?;
        if reader.metadata().get("format").map(String::as_str) != Some(FIELD_FORMAT) {
            return Err(not("its metadata does not name the format omnix-field"));
        }
        let version = reader.metadata().get("version").map_or("(none)", String::as_str);
        if !READ.contains(&version) {
            let (found, path) = (version.to_owned(), path.to_owned());
            return Err(IoError::FieldVersion { found, known: READ_NAMES, path });
        }
        for (name, info) in reader.tensors() {
            if info.known().is_none_or(|dtype| !TYPES.contains(&dtype)) {
                let reason = "is neither F32 nor F16 nor U32 nor F64".into();
                return Err(IoError::FieldTensor { name: name.to_owned(), reason, path: path.to_owned() });
            }
        }
        Ok(Self(reader))
    }

    /// A string of the metadata.
    #[must_use]
    pub fn metadata(&self, name: &str) -> Option<&str> {
        self.0.metadata().get(name).map(String::as_str)
    }

    /// All tensors in the order of the file.
    #[must_use]
    pub fn specs(&self) -> Vec<TensorSpec> {
        let spec = |(name, info): (&str, &omnix_tensors::TensorInfo)| {
            Some(TensorSpec::new(name, info.known()?, info.shape.clone()))
        };
        self.0.tensors().into_iter().filter_map(spec).collect()
    }

    /// Whether there is such a tensor.
    #[must_use]
    pub fn has(&self, name: &str) -> bool {
        self.0.info(name).is_some()
    }

    /// Bytes read from the file so far.
    #[must_use]
    pub fn bytes_read(&self) -> u64 {
        self.0.bytes_read()
    }

    /// An error unless the tensor has this shape.
    ///
    /// # Errors
    /// No tensor of that name, or of another shape.
    pub fn expect_shape(&self, name: &str, shape: &[usize]) -> Result<(), IoError> {
        let refuse = |reason| Err(IoError::FieldTensor { name: name.into(), reason, path: self.0.path().to_owned() });
        match self.0.info(name) {
            None => refuse("is missing".to_owned()),
            Some(info) if info.shape != shape => refuse(format!("is {:?} instead of {shape:?}", info.shape)),
            Some(_) => Ok(()),
        }
    }

    /// Elements of a tensor of floats, counted in C order.
    ///
    /// # Errors
    /// No such tensor, elements outside it, a tensor of integers; a failure of reading.
    pub fn read(&self, name: &str, elements: Range<usize>) -> Result<Vec<f32>, IoError> {
        self.0.read_f32(name, elements).map_err(reading)
    }

    /// Elements of an F64 or F32 tensor, counted in C order.
    ///
    /// # Errors
    /// As [`FieldReader::read`].
    pub fn read_f64(&self, name: &str, elements: Range<usize>) -> Result<Vec<f64>, IoError> {
        self.0.read_f64(name, elements).map_err(reading)
    }

    /// Elements of a u32 tensor, counted in C order.
    ///
    /// # Errors
    /// No such tensor, elements outside it, a tensor of floats; a failure of reading.
    pub fn read_u32(&self, name: &str, elements: Range<usize>) -> Result<Vec<u32>, IoError> {
        self.0.read_u32(name, elements).map_err(reading)
    }

    /// Rows of `width` elements of a tensor of floats, in the order of `rows`; row 0 begins at element `first`. Reads little else.
    ///
    /// # Errors
    /// As [`FieldReader::read`].
    pub fn rows(&self, name: &str, first: usize, width: usize, rows: &[u32]) -> Result<Vec<f32>, IoError> {
        self.0.rows_f32(name, first, width, rows).map_err(reading)
    }

    /// As [`FieldReader::rows`] of a u32 tensor.
    ///
    /// # Errors
    /// As [`FieldReader::read_u32`].
    pub fn rows_u32(&self, name: &str, first: usize, width: usize, rows: &[u32]) -> Result<Vec<u32>, IoError> {
        self.0.rows_u32(name, first, width, rows).map_err(reading)
    }
}

fn reading(error: TensorError) -> IoError {
    match error {
        TensorError::Io { path, source, .. } => IoError::read(path, source),
        other => told(other),
    }
}

fn writing(error: TensorError) -> IoError {
    match error {
        TensorError::Io { path, source, .. } => IoError::write(path, source),
        other => told(other),
    }
}

/// What is wrong with a file of tensors, said of a saved field.
fn told(error: TensorError) -> IoError {
    let tensor = |name, reason: String, path| IoError::FieldTensor { name, reason, path };
    match error {
        TensorError::WrongLength { path, expected, found } if found < expected => {
            IoError::FieldCutShort { expected, found, path }
        }
        TensorError::WrongLength { path, expected, found } => {
            IoError::NotAField { reason: format!("{} bytes follow its last tensor", found - expected), path }
        }
        TensorError::NotPlain { found, path } => IoError::NotAField { reason: format!("it is {found}"), path },
        TensorError::NotSafetensors { reason, path } => IoError::NotAField { reason, path },
        TensorError::PyTorch { path, .. } => {
            IoError::NotAField { reason: "it is a PyTorch checkpoint".to_owned(), path }
        }
        TensorError::BadHeader { tensor: name, reason, path } => tensor(name, format!("is damaged: {reason}"), path),
        TensorError::OutOfTurn { tensor: name, reason, path } => tensor(name, reason, path),
        TensorError::Missing { tensor: name, path } => tensor(name, "is missing".to_owned(), path),
        TensorError::WrongType { tensor: name, wanted: "U32", path, .. } => {
            tensor(name, "holds floats where integers are wanted".to_owned(), path)
        }
        TensorError::WrongType { tensor: name, dtype: _, wanted: _, path } => {
            tensor(name, "holds integers where numbers are wanted".to_owned(), path)
        }
        TensorError::BadRange { tensor: name, range, elements, path } => {
            tensor(name, format!("has {elements} elements, not {}..{}", range.start, range.end), path)
        }
        TensorError::DoesNotFit { tensor, index, value, path, .. } => {
            IoError::FieldDoesNotFit { name: tensor, index, value, path }
        }
        other => IoError::NotAField { reason: other.to_string(), path: PathBuf::new() },
    }
}
