//! Peers that MPI has started (`mpirun`, Slurm's `srun`), through the system's MPI library.
//!
//! A call that fails ends all processes (MPI's own rule, which we keep): the launcher names the one that was lost, and the last
//! checkpoint is good.

use mpi::Threading;
use mpi::collective::SystemOperation;
use mpi::environment::Universe;
use mpi::topology::SimpleCommunicator;
use mpi::traits::{Communicator as _, CommunicatorCollectives as _, Root as _};

use super::Peers;
use crate::TrainError;

/// Numbers of one message: the counts of MPI's calls have 31 bits, and a message is held twice.
const MESSAGE: usize = 1 << 24;

/// All processes that were started together.
pub struct Mpi {
    world: SimpleCommunicator,
    /// Ends MPI when it is dropped, after all that uses it.
    _universe: Universe,
}

impl std::fmt::Debug for Mpi {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Mpi").field("rank", &self.rank()).field("count", &self.count()).finish_non_exhaustive()
    }
}

impl Mpi {
    /// Meets the others. Once a process, from the thread that trains.
    ///
    /// # Errors
    /// When MPI was begun before.
    pub fn begin() -> Result<Self, TrainError> {
        let again = || TrainError::contradiction("MPI", "it can be begun only once in a process");
        let (universe, _) = mpi::initialize_with_threading(Threading::Funneled).ok_or_else(again)?;
        Ok(Self { world: universe.world(), _universe: universe })
    }

    /// Ends all processes at once: for a failure that the others do not know of, who would wait for ever.
    pub fn abort(&self, code: i32) -> ! {
        self.world.abort(code)
    }
}

impl Drop for Mpi {
    fn drop(&mut self) {
        // MPI's own end waits for the others, and these for what a process that has panicked will never send.
        if std::thread::panicking() {
            self.abort(101);
        }
    }
}

impl Peers for Mpi {
    fn rank(&self) -> u32 {
        self.world.rank().unsigned_abs()
    }

    fn count(&self) -> u32 {
        self.world.size().unsigned_abs()
    }

    fn gather(&self, mine: &[u8]) -> Result<Vec<Vec<u8>>, TrainError> {
        // All hand in as much as the longest.
        let (own, mut longest) = (mine.len() as u64, 0u64);
        self.world.all_reduce_into(&own, &mut longest, SystemOperation::max());
        let mut lengths = vec![0u64; self.count() as usize];
        self.world.all_gather_into(&own, &mut lengths[..]);
        let longest = longest as usize;
        let mut sent = mine.to_vec();
        sent.resize(longest, 0);
        let mut all = vec![0u8; longest * lengths.len()];
        self.world.all_gather_into(&sent[..], &mut all[..]);
        let texts = all.chunks_exact(longest.max(1)).zip(&lengths);
        Ok(texts.map(|(text, length)| text[..*length as usize].to_vec()).collect())
    }

    fn broadcast(&self, root: u32, numbers: &mut [f32]) -> Result<(), TrainError> {
        let root = self.world.process_at_rank(root.cast_signed());
        numbers.chunks_mut(MESSAGE).for_each(|message| root.broadcast_into(message));
        Ok(())
    }
}
