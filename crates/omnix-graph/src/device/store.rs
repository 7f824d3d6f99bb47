//! Parameters on the device: read once from the checkpoint, packed as their readers want them, in few buffers.

use std::ops::ControlFlow;

use omnix_kernels::{BufferSlice, Gpu};
use rustc_hash::FxHashMap;

use super::source::ParameterSource;
use super::upload::upload;
use crate::error::GraphError;
use crate::graph::WeightKey;

/// Parameters uploaded to one device; several plans may share them. The default has none.
#[derive(Debug, Default)]
pub struct WeightStore {
    slices: FxHashMap<WeightKey, BufferSlice>,
    bytes: u64,
}

impl WeightStore {
    /// Reads, packs and uploads `keys`, several side by side; `progress` is called with the bytes done and the total, and may break off.
    ///
    /// # Errors
    /// When a tensor cannot be read, memory runs out, or `progress` broke off ([`GraphError::Interrupted`]).
    pub async fn load_async(
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
        })
        .await?;
        Ok(Self { slices: distinct.into_iter().cloned().zip(slices).collect(), bytes })
    }

    /// As [`WeightStore::load_async`], blocking.
    ///
    /// # Errors
    /// As there.
    #[cfg(not(target_arch = "wasm32"))]
    pub fn load(
        gpu: &Gpu,
        source: &dyn ParameterSource,
        keys: &[WeightKey],
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<Self, GraphError> {
        pollster::block_on(Self::load_async(gpu, source, keys, progress))
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
