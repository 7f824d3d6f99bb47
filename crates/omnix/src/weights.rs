//! A checkpoint with its network: found, opened, checked name by name before anything runs.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;

use omnix_graph::{ParameterSource, WeightKey};
use omnix_model::config::NetworkConfig;
use omnix_model::{Network, Parts};
use omnix_weights::{CheckReport, Checkpoint, Verified};
use rayon::prelude::*;

use crate::error::OmnixError;

/// A checked checkpoint. Cheap to clone.
#[derive(Clone, Debug)]
pub struct Weights {
    checkpoint: Arc<Checkpoint>,
    network: Network,
    report: Arc<CheckReport>,
    note: Option<&'static str>,
}

/// Name of the embedded checkpoint.
const BUILTIN: &str = "nano";

/// What every report says of the embedded checkpoint.
#[cfg(feature = "builtin")]
const BUILTIN_NOTE: &str = "nano is a very small network (6.7 M parameters) trained for an hour on made rooms: of a room it sees the rough layout, \
     of other pictures little more, and its motion has not been learned; for results use a published checkpoint";

impl Weights {
    /// The checkpoint in the library itself (feature `builtin`).
    ///
    /// # Errors
    /// Only if the program is damaged.
    #[cfg(feature = "builtin")]
    pub fn builtin() -> Result<Self, OmnixError> {
        let config = include_str!("../../../assets/weights/nano/config.json");
        let bytes: &'static [u8] = include_bytes!("../../../assets/weights/nano/model.safetensors");
        let mut weights = Self::of(Checkpoint::from_bytes(BUILTIN, config, Cow::Borrowed(bytes))?)?;
        weights.note = Some(BUILTIN_NOTE);
        Ok(weights)
    }

    /// A folder with `config.json` and `model.safetensors`, or the file itself.
    ///
    /// # Errors
    /// When files are missing, damaged, or of another model: names what.
    pub fn open(path: &Path) -> Result<Self, OmnixError> {
        Self::of(Checkpoint::open(path)?)
    }

    /// `nano` (with feature `builtin`) or a path.
    ///
    /// # Errors
    /// As [`Weights::open`]; [`OmnixError::NotBuiltIn`] for `nano` where it was left out.
    pub fn find(name_or_path: &str) -> Result<Self, OmnixError> {
        if name_or_path != BUILTIN || Path::new(BUILTIN).exists() {
            return Self::open(Path::new(name_or_path));
        }
        #[cfg(feature = "builtin")]
        return Self::builtin();
        #[cfg(not(feature = "builtin"))]
        return Err(OmnixError::NotBuiltIn { name: BUILTIN });
    }

    fn of(checkpoint: Checkpoint) -> Result<Self, OmnixError> {
        let config = NetworkConfig::from_json(checkpoint.config_json())?;
        // A network with trajectories must have all it needs for them, whatever a run will ask.
        let parts = Parts { motion: config.trajectory.is_some(), ..Parts::default() };
        let report = omnix_weights::check(&checkpoint, &omnix_model::manifest(&config, &parts)).into_result()?;
        Ok(Self {
            checkpoint: Arc::new(checkpoint),
            network: Network::new(config),
            report: Arc::new(report),
            note: None,
        })
    }

    /// The files.
    #[must_use]
    pub fn checkpoint(&self) -> &Checkpoint {
        &self.checkpoint
    }

    /// The network they are for.
    #[must_use]
    pub fn network(&self) -> &Network {
        &self.network
    }

    /// What was found beside the expected tensors.
    #[must_use]
    pub fn report(&self) -> &CheckReport {
        &self.report
    }

    /// A caution that belongs with every result.
    #[must_use]
    pub fn note(&self) -> Option<&'static str> {
        self.note
    }

    /// Reads the files once, on all processors, and checks what `keys` need of them: finite numbers, which fit the type they will be
    /// stored as. `progress` is told bytes read and in all.
    ///
    /// # Errors
    /// [`OmnixError::NonFinite`] or [`omnix_graph::GraphError::DoesNotFit`] for the first tensor by name; `progress` broke off.
    pub(crate) fn verify(
        &self,
        keys: &[WeightKey],
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Result<(), OmnixError> {
        let verified = self.checkpoint.verify(progress).ok_or(OmnixError::Interrupted)?;
        let mut sorted: Vec<&WeightKey> = keys.iter().collect();
        sorted.sort_by(|a, b| a.parameter.name.cmp(&b.parameter.name));
        sorted.into_iter().try_for_each(|key| self.check(key, verified))
    }

    fn check(&self, key: &WeightKey, verified: &Verified) -> Result<(), OmnixError> {
        let name = &key.parameter.name;
        let found = self.checkpoint.findings(verified, name);
        finite(name, found.non_finite)?;
        if found.beyond_f16.is_some() && key.is_half() {
            // Rare. The key may be a block of the tensor that is elsewhere: only packing tells.
            let numbers = self.checkpoint.tensor(name)?.as_f32();
            key.check(&numbers)?;
        }
        Ok(())
    }
}

/// Index of the first value that is NaN or infinite. Pieces are examined without a branch, so that it is done many at a time.
fn first_bad(numbers: &[f32]) -> Option<usize> {
    const PIECE: usize = 1 << 16;
    let piece = numbers.par_chunks(PIECE).position_first(|p| !p.iter().fold(true, |good, v| good & v.is_finite()))?;
    numbers[piece * PIECE..].iter().position(|v| !v.is_finite()).map(|i| piece * PIECE + i)
}

fn finite(name: &str, found: Option<(usize, f32)>) -> Result<(), OmnixError> {
    found.map_or(Ok(()), |(index, value)| Err(OmnixError::NonFinite { name: name.to_owned(), index, value }))
}

impl ParameterSource for Weights {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        let numbers = self.checkpoint.tensor(name).map_err(OmnixError::from)?.as_f32();
        // What was verified is not looked at again.
        let bad = match self.checkpoint.verified() {
            Some(verified) => self.checkpoint.findings(verified, name).non_finite,
            None => first_bad(&numbers).map(|i| (i, numbers[i])),
        };
        finite(name, bad)?;
        Ok(numbers)
    }

    fn release(&self, name: &str) {
        self.checkpoint.release(name);
    }
}
