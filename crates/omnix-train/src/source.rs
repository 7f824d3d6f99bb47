//! What a source of samples is.

use omnix_data::Sample;

use crate::TrainError;

/// Something that has a sample for every number.
pub trait Source: Send + Sync {
    /// For messages: what it is, and where.
    fn label(&self) -> String;

    /// Sample `number`: a function of (seed, number), whatever was asked for before.
    ///
    /// # Errors
    /// What keeps it from being read or made.
    fn sample(&self, seed: u64, number: u64) -> Result<Sample, TrainError>;
}
