//! Parameters on the device: read once from the checkpoint, packed as their readers want them, in few buffers.

use std::borrow::Cow;
use std::ops::ControlFlow;

use omnix_kernels::dispatch::round_up;
use omnix_kernels::packed::fits_f16;
use omnix_kernels::winograd::transform;
use omnix_kernels::{BufferSlice, Gpu, WeightType};
use rustc_hash::FxHashMap;

use crate::error::GraphError;
use crate::graph::Parameter;
use crate::op::WeightForm;
use crate::plan::packed_shape;
use crate::upload::upload;

/// Where parameters come from; several are read at a time.
pub trait ParameterSource: Sync {
    /// All numbers of the tensor `name`, row-major.
    ///
    /// # Errors
    /// Whatever keeps it from being read: missing, damaged, not finite.
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>>;

    /// Called once the data returned by `read(name)` is no longer needed, so that a mapped source can drop its pages.
    fn release(&self, name: &str) {
        let _ = name;
    }
}

/// How a parameter lies on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Packing {
    /// As in the checkpoint, f32.
    Plain,
    /// A transposed convolution's bias, once for each pixel of a block.
    Repeat,
    /// Blocks of 32 columns, see `omnix_kernels::packed`.
    Matrix(WeightForm, WeightType),
}

/// One stored parameter.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct WeightKey {
    /// What it is in the checkpoint.
    pub parameter: Parameter,
    /// How it is stored.
    pub packing: Packing,
}

/// A repeated bias is stored for blocks of up to 4×4 pixels.
const MAX_BLOCK: u64 = 16;

impl WeightKey {
    /// Bytes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let dims = self.parameter.shape();
        let elements = dims.elements() as u64;
        let bytes = match self.packing {
            Packing::Plain => elements * 4,
            Packing::Repeat => elements * 4 * MAX_BLOCK,
            Packing::Matrix(form, storage) => packed_shape(&dims, form, storage).bytes(),
        };
        round_up(bytes, 256)
    }

    /// Writes the stored bytes to `out`, which is all zeros, from all numbers of the checkpoint's tensor.
    ///
    /// # Errors
    /// [`GraphError::DoesNotFit`] for the first number that is finite and would be stored as infinity.
    pub(crate) fn pack(&self, all: &[f32], out: &mut [u8]) -> Result<(), GraphError> {
        let (dims, data) = (self.parameter.shape(), self.parameter.block(all));
        let row: usize = dims.get(1..).map_or(1, |rest| rest.iter().product());
        let mut write = |bytes: &[u8]| out[..bytes.len()].copy_from_slice(bytes);
        let packed = match self.packing {
            Packing::Plain => {
                write(bytemuck::cast_slice(&data));
                Ok(())
            }
            Packing::Repeat => {
                write(bytemuck::cast_slice(&data.repeat(MAX_BLOCK as usize)));
                Ok(())
            }
            Packing::Matrix(form, storage) => {
                let shape = packed_shape(&dims, form, storage);
                match form {
                    WeightForm::Linear => shape.pack_into(|k, n| data[n * row + k], out),
                    WeightForm::Conv => {
                        let (channels, taps) = (dims[1], dims[2] * dims[3]);
                        shape.pack_into(|k, n| data[n * row + k % channels * taps + k / channels], out)
                    }
                    WeightForm::Winograd => {
                        let channels = dims[1];
                        let places: Vec<_> = data.as_chunks().0.iter().map(|taps| transform(*taps)).collect();
                        shape.pack_into(|k, n| places[n * channels + k % channels][k / channels], out)
                    }
                    WeightForm::ConvTranspose => {
                        let (width, taps) = (dims[1], dims[2] * dims[3]);
                        shape.pack_into(|k, n| data[k * row + n % width * taps + n / width], out)
                    }
                }
            }
        };
        packed.map_err(|found| {
            // Packing knows a place in the matrix; a reader of the message looks for one in the checkpoint's tensor.
            let within = data.iter().position(|v| !fits_f16(*v));
            let place = within.map_or_else(|| vec![found.n, found.k], |at| self.parameter.indices(at));
            let value = within.map_or(found.value, |at| data[at]);
            GraphError::DoesNotFit { name: self.parameter.name.to_string(), place, value }
        })
    }

    /// Whether numbers are stored as f16, so that magnitudes from 65520 on do not fit.
    #[must_use]
    pub fn is_half(&self) -> bool {
        matches!(self.packing, Packing::Matrix(_, WeightType::F16))
    }
}

/// Parameters uploaded to one device; several plans may share them. The default has none.
#[derive(Debug, Default)]
pub struct WeightStore {
    slices: FxHashMap<WeightKey, BufferSlice>,
    bytes: u64,
}

impl WeightStore {
    /// Reads, packs and uploads `keys`, several side by side; `progress` hears bytes done and in all, and may break off.
    ///
    /// # Errors
    /// When a tensor cannot be read, memory runs out, or `progress` broke off ([`GraphError::Interrupted`]).
    pub fn load(
        gpu: &Gpu,
        source: &dyn ParameterSource,
        keys: &[WeightKey],
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Self, GraphError> {
        let mut seen = rustc_hash::FxHashSet::default();
        let distinct: Vec<&WeightKey> = keys.iter().filter(|k| seen.insert(*k)).collect();
        let total = distinct.iter().map(|k| k.bytes()).sum();
        let mut done = 0;
        let (slices, bytes) = upload(gpu, source, &distinct, &mut |written| {
            done += written;
            progress(done, total)
        })?;
        Ok(Self { slices: distinct.into_iter().cloned().zip(slices).collect(), bytes })
    }

    /// Bytes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    pub(crate) fn get(&self, key: &WeightKey) -> Option<&BufferSlice> {
        self.slices.get(key)
    }
}
