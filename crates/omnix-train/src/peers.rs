//! Several processes that train one network, each on samples of its own (data parallel).
//!
//! ```text
//! samples of a step, in their order     0 .. a-1        a .. 2a-1       ..     a = accumulate
//! process (rank)                        0               1               ..
//! gradient                              g0 = Σ          g1 = Σ          ..
//! every process                         ((g0 + g1) + g2) + ..
//! ```
//!
//! The sums are taken on the device in the order of ranks, by the kernel that adds up the samples of one process: with one sample each,
//! the processes together have the bits of one process that accumulates all of them. Every process then changes its weights alike; the
//! first one ("leader", rank 0) alone validates and writes.
//!
//! Before gradients are exchanged, each process tells how its part of the step ended (`ended.rs`): if one has failed, or was asked to
//! stop, all stop in the same step.

#[cfg(feature = "mpi")]
mod mpi;
#[cfg(test)]
pub(crate) mod threads;

use crate::TrainError;

#[cfg(feature = "mpi")]
pub use self::mpi::Mpi;

/// The processes of a training, of which this is one. All of them call the same methods in the same order.
pub trait Peers {
    /// This process, from 0.
    fn rank(&self) -> u32;

    /// Number of processes.
    fn count(&self) -> u32;

    /// What each process hands in, in the order of ranks.
    ///
    /// # Errors
    /// When a process cannot be reached.
    fn gather(&self, mine: &[u8]) -> Result<Vec<Vec<u8>>, TrainError>;

    /// Gives the numbers of process `root` to all others.
    ///
    /// # Errors
    /// When a process cannot be reached.
    fn broadcast(&self, root: u32, numbers: &mut [f32]) -> Result<(), TrainError>;
}

/// Which samples of a run are this process's, in their order.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Turns {
    /// The next sample of the run.
    first: u64,
    /// Samples of a step that are this process's.
    own: u64,
    /// Those of all processes.
    all: u64,
    /// Those of the processes before it.
    before: u64,
}

impl Turns {
    /// From sample `first` on; each process has `accumulate` samples of a step.
    #[must_use]
    pub fn new(first: u64, accumulate: u32, peers: Option<&dyn Peers>) -> Self {
        let own = u64::from(accumulate.max(1));
        let (rank, count) = peers.map_or((0, 1), |peers| (u64::from(peers.rank()), u64::from(peers.count())));
        Self { first, own, all: own * count, before: own * rank }
    }

    /// The number of this process's `n`-th sample.
    #[must_use]
    pub const fn number(&self, n: u64) -> u64 {
        self.first + n / self.own * self.all + self.before + n % self.own
    }
}

#[cfg(test)]
mod tests {
    use super::threads::Threads;
    use super::*;

    #[test]
    fn every_sample_has_one_process() {
        let numbers = |rank| {
            let peers = Threads::alone(rank, 3);
            let turns = Turns::new(10, 2, Some(&peers));
            (0..4).map(|n| turns.number(n)).collect::<Vec<_>>()
        };
        assert_eq!(
            (numbers(0), numbers(1), numbers(2)),
            (vec![10, 11, 16, 17], vec![12, 13, 18, 19], vec![14, 15, 20, 21])
        );
        assert_eq!((0..3).map(|n| Turns::new(4, 2, None).number(n)).collect::<Vec<_>>(), [4, 5, 6]);
    }
}
