//! What can be wrong with a file of tensors. Every message names the thing and the cure, the path last.

use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

/// Errors of reading and writing tensors.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum TensorError {
    /// A pipe, a device or a folder where a file is needed.
    #[error("{found} is there instead of a plain file: copy what it gives to a file first: {}", path.display())]
    NotPlain {
        /// What is there.
        found: &'static str,
        /// Where.
        path: PathBuf,
    },

    /// The system refused.
    #[error("cannot {action}: {}", path.display())]
    Io {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The system's answer.
        #[source]
        source: io::Error,
    },

    /// A checkpoint of PyTorch that is refused.
    #[error("this PyTorch checkpoint cannot be read: {reason}: {}", path.display())]
    PyTorch {
        /// The file.
        path: PathBuf,
        /// Why, and the cure.
        reason: String,
    },

    /// The bytes are something else.
    #[error("not a safetensors file ({reason}); get the file again: {}", path.display())]
    NotSafetensors {
        /// The file.
        path: PathBuf,
        /// What was found instead.
        reason: String,
    },

    /// The header parses but contradicts itself or the format.
    #[error("damaged safetensors header: tensor {}: {reason}; get the file again: {}", shown(tensor), path.display())]
    BadHeader {
        /// The file.
        path: PathBuf,
        /// The tensor whose entry is wrong.
        tensor: String,
        /// What is wrong with it.
        reason: String,
    },

    /// The file is shorter (or longer) than its header says.
    #[error(
        "the file is {}: its header says {expected} bytes, it has {found}; get it again: {}",
        if found < expected { "truncated" } else { "longer than it should be" }, path.display()
    )]
    WrongLength {
        /// The file.
        path: PathBuf,
        /// Bytes by the header.
        expected: u64,
        /// Bytes there are.
        found: u64,
    },

    /// No tensor of that name.
    #[error("the file has no tensor {}: {}", shown(tensor), path.display())]
    Missing {
        /// The name.
        tensor: String,
        /// The file.
        path: PathBuf,
    },

    /// The tensor's element type is not one that can be read that way.
    #[error("tensor {} has type {}; convert the file so that it has {wanted}: {}", shown(tensor), shown(dtype), path.display())]
    WrongType {
        /// The name.
        tensor: String,
        /// The type as the header writes it.
        dtype: String,
        /// The types that can be read.
        wanted: &'static str,
        /// The file.
        path: PathBuf,
    },

    /// Elements that the tensor does not have.
    #[error("tensor {} has {elements} elements, not {}..{}: {}", shown(tensor), range.start, range.end, path.display())]
    BadRange {
        /// The name.
        tensor: String,
        /// The range asked for.
        range: Range<usize>,
        /// Elements in the tensor.
        elements: usize,
        /// The file.
        path: PathBuf,
    },

    /// A number that is finite, and would be infinite as the file stores it.
    #[error("{}[{index}] = {value} does not fit in {dtype}; store it as {wider}: {}", shown(tensor), path.display())]
    DoesNotFit {
        /// The tensor.
        tensor: String,
        /// Index of the element, row by row.
        index: usize,
        /// What it is.
        value: f64,
        /// The type it was to be stored as.
        dtype: &'static str,
        /// A type that holds it.
        wider: &'static str,
        /// The file.
        path: PathBuf,
    },

    /// Tensors that were not announced like that; a mistake of the program that writes.
    #[error("tensor {} {reason}: {}", shown(tensor), path.display())]
    OutOfTurn {
        /// The tensor.
        tensor: String,
        /// What is wrong.
        reason: String,
        /// The file.
        path: PathBuf,
    },
}

impl TensorError {
    pub(crate) fn io(action: &'static str, path: &Path, source: io::Error) -> Self {
        Self::Io { action, path: path.to_owned(), source }
    }
}

/// A name from a file as messages show it: control characters escaped, so that it cannot steer a terminal, and cut.
fn shown(name: &str) -> String {
    const LONGEST: usize = 200;
    let escaped: String = name.chars().take(LONGEST).flat_map(char::escape_debug).collect();
    if name.chars().nth(LONGEST).is_some() { escaped + "..." } else { escaped }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_cannot_steer_a_terminal() {
        let error = TensorError::Missing { tensor: "a\x1b[2J\n".repeat(100), path: "f".into() };
        let message = error.to_string();
        assert!(message.contains(r"a\u{1b}[2J\na") && !message.contains('\x1b'), "{message}");
        assert!(message.len() < 2000 && message.contains("..."), "{message}");
    }
}
