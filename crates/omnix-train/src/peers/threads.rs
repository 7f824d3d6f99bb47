//! Threads of one process as peers, for tests.

use std::sync::{Arc, Barrier, Mutex};

use super::Peers;
use crate::TrainError;

/// What the threads hand in, by rank.
type Table = Arc<Mutex<Vec<Vec<u8>>>>;

/// One of several threads.
pub(crate) struct Threads {
    rank: u32,
    table: Table,
    barrier: Arc<Barrier>,
}

/// Runs one function in each of `count` threads; what came of it, by rank.
pub(crate) fn together<T: Send>(count: u32, each: impl Fn(&Threads) -> T + Sync) -> Vec<T> {
    let (table, barrier) = (Table::default(), Arc::new(Barrier::new(count as usize)));
    table.lock().unwrap().resize(count as usize, Vec::new());
    std::thread::scope(|scope| {
        let threads: Vec<_> = (0..count)
            .map(|rank| {
                let peers = Threads { rank, table: table.clone(), barrier: barrier.clone() };
                let each = &each;
                scope.spawn(move || each(&peers))
            })
            .collect();
        threads.into_iter().map(|thread| thread.join().unwrap()).collect()
    })
}

impl Threads {
    /// One that never meets the others.
    pub(crate) fn alone(rank: u32, count: u32) -> Self {
        let table = Arc::new(Mutex::new(vec![Vec::new(); count as usize]));
        Self { rank, table, barrier: Arc::new(Barrier::new(1)) }
    }
}

impl Peers for Threads {
    fn rank(&self) -> u32 {
        self.rank
    }

    fn count(&self) -> u32 {
        self.table.lock().unwrap().len() as u32
    }

    fn gather(&self, mine: &[u8]) -> Result<Vec<Vec<u8>>, TrainError> {
        self.table.lock().unwrap()[self.rank as usize] = mine.to_vec();
        self.barrier.wait();
        let all = self.table.lock().unwrap().clone();
        self.barrier.wait();
        Ok(all)
    }

    fn broadcast(&self, root: u32, numbers: &mut [f32]) -> Result<(), TrainError> {
        let all = self.gather(bytemuck::cast_slice(numbers))?;
        numbers.copy_from_slice(&bytemuck::pod_collect_to_vec::<u8, f32>(&all[root as usize]));
        Ok(())
    }
}
