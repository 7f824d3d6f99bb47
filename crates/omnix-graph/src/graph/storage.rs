//! How parameters are stored on a device: which form each reader wants, and how many bytes that takes.

use omnix_kernels::dispatch::round_up;
use omnix_kernels::pack::Order;
use omnix_kernels::packed::fits_f16;
use omnix_kernels::winograd::{PLACES, transform};
use omnix_kernels::{PackedWeights, WeightType};

use super::parameter::Parameter;
use super::value::Value;
use super::values::{Source, Values};
use crate::error::GraphError;

/// How a parameter is packed for the matrix product that reads it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum WeightForm {
    /// `[out, in]`: column n is row n.
    Linear,
    /// `[out, in, rows, columns]` of a convolution: depth in the order (row, column, in).
    Conv,
    /// `[out, in, 3, 3]` transformed for Winograd's algorithm: depth in the order (place, in), `winograd::PLACES` places.
    Winograd,
    /// `[in, out, k, k]` of a transposed convolution with stride k: columns in the order (row, column, out).
    ConvTranspose,
    /// `[out, in]` as the matrix of the gradient of a linear layer's input: column n is column n.
    LinearGradient,
    /// `[out, in, rows, columns]` as the kernel of the gradient of a convolution's input: taps in reverse, depth in the order (row,
    /// column, out).
    ConvGradient,
    /// `[out, in, 3, 3]` turned around as in [`Self::ConvGradient`] and transformed for Winograd's algorithm: depth in the order (place, out).
    WinogradGradient,
    /// `[in, out, k, k]` as the matrix of the gradient of a transposed convolution's input: depth in the order (row, column, out).
    ConvTransposeGradient,
}

impl WeightForm {
    /// The form of the gradient of the input of what reads this form; none for those that only inference reads.
    #[must_use]
    pub const fn gradient(self) -> Option<Self> {
        match self {
            Self::Linear => Some(Self::LinearGradient),
            Self::Conv => Some(Self::ConvGradient),
            Self::ConvTranspose => Some(Self::ConvTransposeGradient),
            Self::LinearGradient | Self::ConvGradient | Self::ConvTransposeGradient => None,
            Self::Winograd | Self::WinogradGradient => None,
        }
    }

    /// The form that Winograd's algorithm reads in place of a convolution's; none for what it does not compute.
    #[must_use]
    pub const fn by_winograd(self) -> Option<Self> {
        match self {
            Self::Conv => Some(Self::Winograd),
            Self::ConvGradient => Some(Self::WinogradGradient),
            _ => None,
        }
    }

    /// Whether Winograd's algorithm reads it.
    #[must_use]
    pub const fn is_winograd(self) -> bool {
        matches!(self, Self::Winograd | Self::WinogradGradient)
    }

    /// The form that the sum over taps reads in place of Winograd's.
    #[must_use]
    pub const fn by_taps(self) -> Self {
        match self {
            Self::Winograd => Self::Conv,
            Self::WinogradGradient => Self::ConvGradient,
            other => other,
        }
    }

    /// Where the weights of a tensor of shape `dims` lie that is read in this form, when it begins at `start` and its rows (of the first
    /// dimension) are `row` numbers apart. For Winograd's, where the taps lie that they are computed from.
    #[must_use]
    pub fn order(self, dims: &[usize], (start, row): (u32, u32)) -> Order {
        let product = |dims: &[usize]| dims.iter().product::<usize>() as u32;
        let (inner, taps) = (dims.get(1).map_or(1, |d| *d as u32), product(dims.get(2..).unwrap_or_default()));
        let columns = Order { base: start, n_lo: 1, n_hi: row, n_step: 0, k_lo: 1, k_hi: 1, k_step: 0 };
        match self {
            Self::Linear => columns,
            Self::LinearGradient => Order { n_hi: 1, k_hi: row, ..columns },
            Self::Conv | Self::Winograd => Order { k_lo: inner, k_step: taps, ..columns },
            Self::ConvGradient | Self::WinogradGradient => Order {
                base: start + taps.saturating_sub(1),
                n_hi: taps,
                k_lo: dims.first().map_or(1, |d| *d as u32),
                k_hi: 1u32.wrapping_neg(),
                k_step: row,
                ..columns
            },
            Self::ConvTranspose => Order { n_lo: inner, n_hi: 1, n_step: taps, k_hi: row, ..columns },
            Self::ConvTransposeGradient => Order { k_lo: inner, k_step: taps, ..columns },
        }
    }
}

/// How a parameter lies on the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Packing {
    /// As in the checkpoint, f32.
    Plain,
    /// A transposed convolution's bias, once for each of this number of pixels of a block.
    Repeat(usize),
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

impl WeightKey {
    /// Bytes on the device.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        let dims = self.parameter.shape();
        let elements = dims.elements() as u64;
        let bytes = match self.packing {
            Packing::Plain => elements * 4,
            Packing::Repeat(pixels) => elements * 4 * pixels as u64,
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
            Packing::Repeat(pixels) => {
                write(bytemuck::cast_slice(&data.repeat(pixels)));
                Ok(())
            }
            Packing::Matrix(form, storage) => {
                let shape = packed_shape(&dims, form, storage);
                let order = form.order(&dims, (0, row as u32));
                if form.is_winograd() {
                    let (channels, columns) = (order.k_lo as usize, shape.n as usize);
                    let taps = |n: usize, c: usize| std::array::from_fn(|tap| data[order.index(tap * channels + c, n)]);
                    let all = (0..columns).flat_map(|n| (0..channels).map(move |c| (n, c)));
                    let places: Vec<_> = all.map(|(n, c)| transform(taps(n, c))).collect();
                    shape.pack_into(|k, n| places[n * channels + k % channels][k / channels], out)
                } else {
                    shape.pack_into(|k, n| data[order.index(k, n)], out)
                }
            }
        };
        // Packing knows a place in the matrix; a reader of the message looks for one in the checkpoint's tensor.
        packed.map_err(|found| {
            self.misfit(&data).unwrap_or_else(|| self.does_not_fit(vec![found.n, found.k], found.value))
        })
    }

    /// Whether all numbers of the checkpoint's tensor can be stored, without storing them.
    ///
    /// # Errors
    /// [`GraphError::DoesNotFit`] for the first that is finite and would be stored as infinity.
    pub fn check(&self, all: &[f32]) -> Result<(), GraphError> {
        if self.is_half() { self.misfit(&self.parameter.block(all)).map_or(Ok(()), Err) } else { Ok(()) }
    }

    /// The error for the first number of the block that is finite and infinite as f16.
    fn misfit(&self, data: &[f32]) -> Option<GraphError> {
        let at = data.iter().position(|v| !fits_f16(*v))?;
        Some(self.does_not_fit(self.parameter.indices(at), data[at]))
    }

    fn does_not_fit(&self, place: Vec<usize>, value: f32) -> GraphError {
        GraphError::DoesNotFit { name: self.parameter.name.to_string(), place, value }
    }

    /// Whether numbers are stored as f16, so that magnitudes from 65520 on do not fit.
    #[must_use]
    pub fn is_half(&self) -> bool {
        matches!(self.packing, Packing::Matrix(_, WeightType::F16))
    }
}

/// How the matrix `value` is stored when the plan stores matrices as `storage`; what a node has packed is as the node says. int8 is for linear
/// layers: the kernels of convolutions, four axes long, are f16 then.
pub(crate) fn stored_as(values: &Values, value: Value, storage: WeightType) -> WeightType {
    let info = values.info(values.root(value));
    match &info.source {
        Source::Parameter(p) if p.keep_f32 => WeightType::F32,
        Source::Parameter(_) if storage == WeightType::I8 && values.shape(value).len() != 2 => WeightType::F16,
        Source::Parameter(_) => storage,
        _ => info.stored,
    }
}

/// The packed shape of the matrix of a linear layer or convolution, from the parameter's shape.
#[must_use]
pub fn packed_shape(shape: &[usize], form: WeightForm, storage: WeightType) -> PackedWeights {
    let product = |dims: &[usize]| dims.iter().product::<usize>() as u32;
    let (k, n) = match form {
        WeightForm::Linear | WeightForm::Conv | WeightForm::ConvTransposeGradient => {
            (product(&shape[1..]), shape[0] as u32)
        }
        WeightForm::Winograd => (PLACES * shape[1] as u32, shape[0] as u32),
        WeightForm::WinogradGradient => (PLACES * shape[0] as u32, shape[1] as u32),
        WeightForm::ConvTranspose | WeightForm::LinearGradient => (shape[0] as u32, product(&shape[1..])),
        WeightForm::ConvGradient => (shape[0] as u32 * product(&shape[2..]), shape[1] as u32),
    };
    PackedWeights { k, n, storage }
}
