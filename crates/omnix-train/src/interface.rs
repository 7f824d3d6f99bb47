//! What the loop asks of the machine that computes a step, and what it hands to it.
//!
//! ```text
//! train(sample) × accumulate     forward and backward; gradients are added up; the losses of the sample
//! exchange(peers)                where several processes train together: the gradients of all are added up in each
//! apply(update)                  clip, AdamW, average of the weights; gradients are 0 again; their norm before the clip
//! ```
//!
//! All numbers that a step keeps from one step to the next are in four lists in the order of a [`Layout`]: [`Part`]. They go in and out
//! an arena at a time, so that a host never holds them all.

use omnix_data::Sample;
use omnix_eval::network::Score;

use crate::StepError;
use crate::groups::Layout;
use crate::peers::Peers;

/// A list of numbers, one for each trained number of the network.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// The weights.
    Weights,
    /// Mean of the gradients.
    First,
    /// Mean of their squares.
    Second,
    /// The average of the weights over steps; only where the configuration asks for one.
    Average,
}

/// The losses of one sample.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LossValues {
    /// What is minimised.
    pub total: f64,
    /// The terms by name (`depth`, `trajectory`, ..), each as it is reported; any order, the same in every step.
    pub terms: Vec<(String, f64)>,
}

impl LossValues {
    /// The name of the first number that is NaN or infinite.
    #[must_use]
    pub fn not_finite(&self) -> Option<&str> {
        let term = self.terms.iter().find(|(_, value)| !value.is_finite()).map(|(name, _)| name.as_str());
        term.or_else(|| (!self.total.is_finite()).then_some("total"))
    }

    /// Adds `other`, which has the same terms, times `share`; the first addition takes its terms.
    pub fn add(&mut self, other: &Self, share: f64) {
        self.total += share * other.total;
        if self.terms.is_empty() {
            self.terms = other.terms.iter().map(|(name, _)| (name.clone(), 0.0)).collect();
        }
        for ((_, sum), (_, value)) in self.terms.iter_mut().zip(&other.terms) {
            *sum += share * value;
        }
    }
}

/// The figures of an answer, and of the trivial ones, to a validation sample.
pub type Judged = (Score, [Score; 3]);

/// How the weights change in a step.
#[derive(Debug, Clone, PartialEq)]
pub struct Update {
    /// The step's number, from 1: AdamW corrects its means by it.
    pub step: u64,
    /// Number of samples, of all processes, whose gradients were added: the gradient is their mean.
    pub samples: u32,
    /// Rate of each group, by index; 0 for frozen ones.
    pub rates: Vec<f64>,
    /// Weight decay of each group, per unit of rate.
    pub decays: Vec<f64>,
    /// The norm that the gradient of all groups together is clipped to.
    pub clip: Option<f64>,
    /// Share of the old average of the weights that is kept; none where no average is asked for.
    pub average: Option<f64>,
}

/// The machine that computes a step.
pub trait Step {
    /// Where its trained tensors lie.
    fn layout(&self) -> &Layout;

    /// The machine in words: two that have the same words compute the same bits.
    fn device(&self) -> String;

    /// Forward and backward on one sample, which is normalised; the gradient is added to that of the samples since the last update.
    /// `number` is the sample's, for random numbers that the network itself draws.
    ///
    /// # Errors
    /// Whatever keeps it from being computed.
    fn train(&mut self, sample: &Sample, number: u64) -> Result<LossValues, StepError>;

    /// Forward only, as in inference. `averaged`: with the average of the weights, where there is one. The losses, and what an evaluation
    /// says of the answer and of the trivial ones, where the step makes an answer.
    ///
    /// # Errors
    /// Whatever keeps it from being computed.
    fn validate(&mut self, sample: &Sample, averaged: bool) -> Result<(LossValues, Option<Judged>), StepError>;

    /// Adds up the gradients of all processes since the last update, in the order of their ranks: the same sum in each of them.
    ///
    /// # Errors
    /// Whatever keeps it from being computed, or a process that cannot be reached.
    fn exchange(&mut self, peers: &dyn Peers) -> Result<(), StepError>;

    /// Changes the weights by the gradients since the last update and forgets these; their norm before the clip.
    ///
    /// # Errors
    /// Whatever keeps it from being computed.
    fn apply(&mut self, update: &Update) -> Result<f64, StepError>;

    /// The name of a tensor whose gradient or weights have a NaN or infinite number, if one can be found. Asked once something is
    /// known to be wrong, so it may take its time.
    fn not_finite(&mut self) -> Option<String>;

    /// The numbers of an arena.
    ///
    /// # Errors
    /// Whatever keeps them from being read.
    fn read(&mut self, part: Part, arena: usize) -> Result<Vec<f32>, StepError>;

    /// Replaces the numbers of an arena.
    ///
    /// # Errors
    /// Whatever keeps them from being written.
    fn write(&mut self, part: Part, arena: usize, numbers: &[f32]) -> Result<(), StepError>;

    /// The values of a tensor that stays as it is ([`Layout::fixed`]).
    ///
    /// # Errors
    /// Whatever keeps them from being read.
    fn fixed(&mut self, name: &str) -> Result<Vec<f32>, StepError>;
}
