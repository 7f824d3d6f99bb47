//! A checkpoint with its network: found, opened, checked name by name before anything runs.

use std::borrow::Cow;
use std::path::Path;
use std::sync::Arc;

use omnix_graph::ParameterSource;
use omnix_model::config::NetworkConfig;
use omnix_model::{Network, Parts};
use omnix_weights::{CheckReport, Checkpoint};
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
const BUILTIN_NOTE: &str = "nano is a very small stand-in (8 M parameters) trained on rendered toy scenes: it shows that everything works, its depth \
     of real pictures is a blur and its motion has not been learned; for results use a published checkpoint with --weights";

impl Weights {
    /// The checkpoint in the program itself.
    ///
    /// # Errors
    /// Only if the program is damaged.
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

    /// `nano` or a path.
    ///
    /// # Errors
    /// As [`Weights::open`].
    pub fn find(name_or_path: &str) -> Result<Self, OmnixError> {
        if name_or_path == BUILTIN && !Path::new(BUILTIN).exists() {
            return Self::builtin();
        }
        Self::open(Path::new(name_or_path))
    }

    fn of(mut checkpoint: Checkpoint) -> Result<Self, OmnixError> {
        let config = NetworkConfig::from_json(checkpoint.config_json())?;
        if let Some(prefix) = config.key_prefix() {
            checkpoint.set_key_prefix(prefix);
        }
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

    /// Looks at every number of every tensor.
    ///
    /// # Errors
    /// [`OmnixError::NonFinite`] for the first that is none.
    pub fn check_numbers(&self) -> Result<(), OmnixError> {
        for file in self.checkpoint.files() {
            for (name, _) in file.tensors() {
                let view = file.tensor(name)?;
                finite(name, omnix_weights::find_non_finite(&view))?;
                file.release(name);
            }
        }
        Ok(())
    }

    /// Looks at every number of one tensor, without keeping any.
    ///
    /// # Errors
    /// When it is missing, or [`OmnixError::NonFinite`].
    pub(crate) fn check_tensor(&self, name: &str) -> Result<(), OmnixError> {
        let view = self.checkpoint.tensor(name)?;
        let found = omnix_weights::find_non_finite(&view);
        self.checkpoint.release(name);
        finite(name, found)
    }
}

/// Where the first number is that is none. Pieces are looked through without a branch, so that it is done many at a time.
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
        let bad = first_bad(&numbers).map(|i| (i, numbers[i]));
        finite(name, bad)?;
        Ok(numbers)
    }

    fn release(&self, name: &str) {
        self.checkpoint.release(name);
    }
}
