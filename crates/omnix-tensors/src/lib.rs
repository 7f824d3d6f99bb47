//! Named tensors in files, for checkpoints, saved fields and training states; no network, no graph, no device.
//!
//! * [`TensorFile`]: a file of safetensors, or a checkpoint that `torch.save` wrote, behind a mapping, or bytes in memory: tensors in
//!   place, converted, or the whole file in pieces.
//! * [`TensorReader`]: a file that is not mapped, of which ranges and rows are read.
//! * [`TensorWriter`]: a file written tensor after tensor, that has its name only when it is whole.
//!
//! Elements lie row-major and little endian. Files are not trusted: whatever the bytes, reading gives an error and neither panics
//! nor takes memory that the file's length does not justify. Nothing in a checkpoint of PyTorch is executed. Other formats are recognised
//! and refused.

mod atomic;
mod convert;
mod dtype;
mod entries;
mod error;
mod file;
mod header;
mod info;
mod mapping;
mod pickle;
mod plain;
mod pytorch;
mod reader;
mod rows;
mod view;
mod writer;

pub use atomic::{AtomicFile, abandon, is_unfinished};
pub use convert::Findings;
pub use dtype::{Dtype, Float};
pub use error::TensorError;
pub use file::{Piece, TensorFile};
pub use info::TensorInfo;
pub use plain::read_text;
pub use reader::TensorReader;
pub use rows::scattered;
pub use view::TensorView;
pub use writer::{TensorSpec, TensorWriter};
