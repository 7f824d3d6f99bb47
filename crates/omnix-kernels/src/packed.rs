//! Weight matrices as the kernels read them: blocks of 32 output columns, `[block][k][32]`
//! (`shaders/lib/weights.wgsl`), f32, f16 with two k side by side in one 32-bit word, or int8 with four.
//!
//! int8 is symmetric, one f32 scale an output column: `w ≈ scale[n] · q`, q in −127..=127, nearest. The scales lie behind the
//! blocks; products are summed over q and scaled once at the end. Only `linear` reads it.

use std::ops::Range;

use half::f16;
use rayon::prelude::*;

use crate::dispatch::round_up;

/// How weights are stored on the device; sums are f32 either way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum WeightType {
    /// 4 bytes per weight.
    #[default]
    F32,
    /// 2 bytes per weight, unpacked in the shader: needs no f16 feature.
    F16,
    /// 1 byte per weight and one scale per output column, for linear layers; what else is stored as half precision stays [`Self::F16`].
    I8,
}

impl WeightType {
    /// k per 128-byte row of a block: how many consecutive k one packed row holds.
    pub(crate) const fn k_per_row(self) -> u64 {
        match self {
            Self::F32 => 1,
            Self::F16 => 2,
            Self::I8 => 4,
        }
    }

    /// Bytes of 32 columns of one packed row.
    pub(crate) const ROW_BYTES: u64 = 128;
}

/// Bytes of weights that stay in a processor's last cache while rows go by.
const CACHED_WEIGHTS: u64 = 4 << 20;
/// Bytes of x that stay in the cache of one core while column blocks go by.
const CACHED_ROWS: u64 = 128 << 10;

/// The shape of a packed weight matrix `[k, n]`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct PackedWeights {
    /// Input depth.
    pub k: u32,
    /// Output columns.
    pub n: u32,
    /// Storage type.
    pub storage: WeightType,
}

impl PackedWeights {
    /// k after padding with zero weights: to a multiple of 4, of 8 for int8, so that blocks start on 256-byte boundaries.
    #[must_use]
    pub const fn k_packed(&self) -> u32 {
        let unit = match self.storage {
            WeightType::F32 | WeightType::F16 => 4,
            WeightType::I8 => 8,
        };
        self.k.div_ceil(unit) * unit
    }

    /// Blocks of 32 columns.
    #[must_use]
    pub const fn blocks(&self) -> u32 {
        self.n.div_ceil(32)
    }

    /// Bytes of one column block.
    #[must_use]
    pub const fn block_bytes(&self) -> u64 {
        self.k_packed() as u64 / self.storage.k_per_row() * WeightType::ROW_BYTES
    }

    /// Where the scales of int8 columns are in the buffer, and their bytes.
    pub(crate) const fn scales(&self) -> (u64, u64) {
        let bytes = match self.storage {
            WeightType::F32 | WeightType::F16 => 0,
            WeightType::I8 => self.blocks() as u64 * 128,
        };
        (round_up(self.block_bytes() * self.blocks() as u64, 256), bytes)
    }

    /// How many of `row_tiles` tiles, each with `tile_bytes` of x, the software variants take past a column block before the next
    /// block: few, where the weights stay in the processor's cache, so that x is read from memory once; all of them,
    /// where the weights do not.
    pub(crate) fn row_group(&self, row_tiles: u64, tile_bytes: u64) -> u32 {
        let weights = self.block_bytes() * u64::from(self.blocks());
        let fit = if weights <= CACHED_WEIGHTS { (CACHED_ROWS / tile_bytes).max(1) } else { row_tiles };
        fit.min(row_tiles) as u32
    }

    /// Size of the buffer: the blocks and int8's scales.
    #[must_use]
    pub const fn bytes(&self) -> u64 {
        let (start, scales) = self.scales();
        round_up(start + scales, 256)
    }

    /// Packs a matrix given by `weight(k, n)`, blocks side by side on all processors; the result has [`PackedWeights::bytes`]
    /// bytes. For weights that are known to fit, as those of tests and measurements.
    ///
    /// # Panics
    /// When a weight does not fit the storage type: [`PackedWeights::pack_into`] says which.
    #[must_use]
    pub fn pack(&self, weight: impl Fn(usize, usize) -> f32 + Sync) -> Vec<u8> {
        let mut out = vec![0u8; self.bytes() as usize];
        if let Err(TooLarge { k, n, value }) = self.pack_into(weight, &mut out) {
            panic!("BUG: weight ({k}, {n}) = {value} does not fit in f16");
        }
        out
    }

    /// As [`PackedWeights::pack`], to where all bytes are 0: what only fills up is not written.
    ///
    /// # Errors
    /// The first weight, column by column, that is finite and becomes infinite as f16. int8 has a scale for every column, so any
    /// finite weight fits.
    pub fn pack_into(&self, weight: impl Fn(usize, usize) -> f32 + Sync, out: &mut [u8]) -> Result<(), TooLarge> {
        let (k, n) = (self.k as usize, self.n as usize);
        let (blocks, tail) = out.split_at_mut(self.scales().0 as usize);
        let blocks = blocks.par_chunks_mut(self.block_bytes() as usize).take(self.blocks() as usize).enumerate();
        let columns = |block: usize| (n - block * 32).min(32);
        match self.storage {
            WeightType::F32 => blocks.for_each(|(block, out)| {
                let rows = out.as_chunks_mut::<4>().0.as_chunks_mut::<32>().0;
                tiled(k, columns(block), |row, column| {
                    rows[row][column] = weight(row, block * 32 + column).to_le_bytes();
                });
            }),
            WeightType::F16 => {
                let first = blocks.filter_map(|(block, out)| {
                    let pairs = out.as_chunks_mut::<2>().0.as_chunks_mut::<2>().0.as_chunks_mut::<32>().0;
                    let mut infinite = false;
                    tiled(k, columns(block), |row, column| {
                        let value = f16::from_f32(weight(row, block * 32 + column));
                        infinite |= value.is_infinite();
                        pairs[row / 2][column][row % 2] = value.to_le_bytes();
                    });
                    let columns = block * 32..block * 32 + columns(block);
                    if infinite { too_large(columns, k, &weight) } else { None }
                });
                // All blocks are packed: which one is reported must not depend on which is done first.
                if let Some(first) = first.min_by_key(|found| (found.n, found.k)) {
                    return Err(first);
                }
            }
            WeightType::I8 => blocks.zip(tail.par_chunks_mut(32 * 4)).for_each(|((block, out), scales)| {
                for (column, to) in scales.as_chunks_mut().0.iter_mut().enumerate().take(columns(block)) {
                    let at = |row| weight(row, block * 32 + column);
                    let largest = (0..k).fold(0.0f32, |most, row| most.max(at(row).abs()));
                    let scale = largest / 127.0;
                    for row in 0..k {
                        // A column of zeros has scale 0, and 0 / 0 becomes 0 as an integer.
                        let q = (at(row) / scale).round() as i8;
                        out[(row / 4 * 32 + column) * 4 + row % 4] = q.to_le_bytes()[0];
                    }
                    *to = scale.to_le_bytes();
                }
            }),
        }
        Ok(())
    }
}

/// A weight that is finite, and infinite as it would be stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TooLarge {
    /// Its input.
    pub k: usize,
    /// Its output column.
    pub n: usize,
    /// What it is.
    pub value: f32,
}

/// The first weight of these columns that f16 cannot hold.
fn too_large(columns: Range<usize>, k: usize, weight: &impl Fn(usize, usize) -> f32) -> Option<TooLarge> {
    let places = columns.flat_map(|n| (0..k).map(move |k| (k, n)));
    let mut values = places.map(|(k, n)| TooLarge { k, n, value: weight(k, n) });
    values.find(|found| !fits_f16(found.value))
}

/// Whether a number that is finite stays so as f16, which rounds magnitudes from 65520 on to infinity. NaN and infinity stay
/// what they are, so they count as fitting.
#[must_use]
pub fn fits_f16(value: f32) -> bool {
    !(value.is_finite() && f16::from_f32(value).is_infinite())
}

/// Every row and column of a block, 16 rows of a column at a time: checkpoints have a column's k side by side, and what
/// one line of the cache holds of it is used while it is there.
fn tiled(rows: usize, columns: usize, mut each: impl FnMut(usize, usize)) {
    for first in (0..rows).step_by(16) {
        for column in 0..columns {
            for row in first..rows.min(first + 16) {
                each(row, column);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::{PackedWeights, TooLarge, WeightType, fits_f16};

    #[test]
    fn packing_puts_32_columns_side_by_side() {
        let shape = PackedWeights { k: 3, n: 33, storage: WeightType::F32 };
        let bytes = shape.pack(|k, n| (k * 100 + n) as f32);
        assert_eq!(bytes.len() as u64, shape.bytes());
        let value = |i: usize| f32::from_le_bytes([bytes[4 * i], bytes[4 * i + 1], bytes[4 * i + 2], bytes[4 * i + 3]]);
        assert_eq!(value(32 + 5), 105.0);
        // Block 1 starts after 4 (padded) rows of 32; its column 1 does not exist.
        assert_eq!((value(4 * 32), value(4 * 32 + 1)), (32.0, 0.0));
    }

    #[test]
    fn f16_keeps_pairs_of_k_together() {
        let shape = PackedWeights { k: 4, n: 1, storage: WeightType::F16 };
        let bytes = shape.pack(|k, _| k as f32);
        assert_eq!(half::f16::from_le_bytes([bytes[2], bytes[3]]).to_f32(), 1.0);
        assert_eq!(half::f16::from_le_bytes([bytes[128], bytes[129]]).to_f32(), 2.0);
    }

    #[test]
    fn int8_keeps_four_k_together_and_the_scales_behind() {
        let shape = PackedWeights { k: 9, n: 40, storage: WeightType::I8 };
        // Column 1 reaches from -254 to 254, all others are 0.
        let bytes = shape.pack(|k, n| if n == 1 { (k as f32 - 4.0) * 63.5 } else { 0.0 });
        assert_eq!(bytes.len() as u64, shape.bytes());
        assert_eq!((shape.k_packed(), shape.block_bytes()), (16, 512));
        let q: Vec<i8> = (0..12).map(|k| bytes[(k / 4 * 32 + 1) * 4 + k % 4].cast_signed()).collect();
        assert_eq!(q, [-127, -95, -64, -32, 0, 32, 64, 95, 127, 0, 0, 0]);
        let scale = |n: usize| f32::from_le_bytes(std::array::from_fn(|i| bytes[2 * 512 + 4 * n + i]));
        assert_eq!((scale(0), scale(1), scale(39)), (0.0, 2.0, 0.0));
    }

    #[test]
    fn a_weight_beyond_f16_is_named_and_one_below_is_not() {
        let packed = |storage, value: f32| {
            let shape = PackedWeights { k: 20, n: 100, storage };
            // Two of them, in different blocks: the one of the lower column is reported.
            let weight = |k, n| if (k, n) == (17, 40) || (k, n) == (3, 90) { value } else { 1.0 };
            shape.pack_into(weight, &mut vec![0; shape.bytes() as usize])
        };
        for value in [65520.0, 70000.0, -1e30, f32::MAX] {
            assert_eq!(packed(WeightType::F16, value), Err(TooLarge { k: 17, n: 40, value }));
            assert_eq!((packed(WeightType::F32, value), packed(WeightType::I8, value)), (Ok(()), Ok(())), "{value}");
        }
        for value in [65519.996, -65504.0, 1e-30] {
            assert_eq!(packed(WeightType::F16, value), Ok(()), "{value}");
        }
        assert!(fits_f16(f32::INFINITY) && fits_f16(f32::NAN) && fits_f16(65519.996) && !fits_f16(65520.0));
    }

    #[test]
    fn int8_holds_any_finite_column() {
        let shape = PackedWeights { k: 8, n: 1, storage: WeightType::I8 };
        for largest in [f32::MAX, 70000.0, 1e-30, f32::MIN_POSITIVE / 4.0] {
            let bytes = shape.pack(|k, _| if k == 0 { -largest } else { largest / 2.0 });
            let scale = f32::from_le_bytes(std::array::from_fn(|i| bytes[shape.scales().0 as usize + i]));
            // In f64: 127 times a rounded scale may lie a little above the largest f32.
            let back = f64::from(bytes[0].cast_signed()) * f64::from(scale);
            assert!(scale.is_finite() && (back / f64::from(-largest) - 1.0).abs() < 1e-2, "{largest}: {back}");
        }
    }
}
