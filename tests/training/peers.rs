//! Several processes that train one network: threads, each with a device of its own.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Barrier, Mutex};

use omnix_kernels::{Gpu, adapter};
use omnix_train::device::ready_among;
use omnix_train::peers::Peers;
use omnix_train::{RunOptions, Session, TrainError, read_config, run};

/// One of two threads, over a table that both write to.
struct Pair<'a> {
    rank: u32,
    table: &'a Mutex<[Vec<u8>; 2]>,
    barrier: &'a Barrier,
}

impl Peers for Pair<'_> {
    fn rank(&self) -> u32 {
        self.rank
    }

    fn count(&self) -> u32 {
        2
    }

    fn gather(&self, mine: &[u8]) -> Result<Vec<Vec<u8>>, TrainError> {
        self.table.lock().unwrap()[self.rank as usize] = mine.to_vec();
        self.barrier.wait();
        let all = self.table.lock().unwrap().to_vec();
        self.barrier.wait();
        Ok(all)
    }

    fn broadcast(&self, root: u32, numbers: &mut [f32]) -> Result<(), TrainError> {
        let all = self.gather(bytemuck::cast_slice(numbers))?;
        numbers.copy_from_slice(&bytemuck::pod_collect_to_vec::<u8, f32>(&all[root as usize]));
        Ok(())
    }
}

/// A launcher that has started one process.
struct Alone;

impl Peers for Alone {
    fn rank(&self) -> u32 {
        0
    }

    fn count(&self) -> u32 {
        1
    }

    fn gather(&self, mine: &[u8]) -> Result<Vec<Vec<u8>>, TrainError> {
        Ok(vec![mine.to_vec()])
    }

    fn broadcast(&self, _: u32, _: &mut [f32]) -> Result<(), TrainError> {
        Ok(())
    }
}

/// Trains the smoke recipe for some steps with this number of samples a process.
fn train(out: &Path, accumulate: u32, peers: Option<&dyn Peers>) {
    let mut recipe = read_config(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../recipes/smoke.toml")).unwrap();
    recipe.config.optimiser.accumulate = accumulate;
    let (device, queue) = adapter::open(&adapter::choose(None).unwrap()).unwrap();
    let mut session = match peers {
        None => Session::open(recipe, out).unwrap(),
        Some(peers) => Session::join(recipe, out, peers).unwrap(),
    };
    let count = peers.map_or(1, Peers::count);
    let mut step = ready_among(&session, &Gpu::new(&device, &queue), None, count).unwrap();
    let stop = AtomicBool::new(false);
    let options = RunOptions::new(3, &stop).peers(peers);
    assert_eq!(run(&mut session, &mut step, options, &mut |_| {}).unwrap().step, 3);
}

/// Two processes with `accumulate` samples each.
fn together(out: &Path, accumulate: u32) {
    let (table, barrier) = (Mutex::default(), Barrier::new(2));
    std::thread::scope(|scope| {
        for rank in 0..2 {
            let (table, barrier) = (&table, &barrier);
            scope.spawn(move || train(out, accumulate, Some(&Pair { rank, table, barrier })));
        }
    });
}

fn state(out: &Path) -> [Vec<u8>; 2] {
    ["last/model.safetensors", "last/state.safetensors"].map(|file| fs::read(out.join(file)).unwrap())
}

#[test]
fn two_processes_with_a_sample_each_have_the_bits_of_one_with_both() {
    let dir = tempfile::tempdir().unwrap();
    let [one, two, four, alone] = ["one", "two", "four", "alone"].map(|name| dir.path().join(name));
    train(&one, 2, None);
    together(&two, 1);
    assert!(state(&one) == state(&two));
    train(&alone, 2, Some(&Alone));
    assert!(state(&one) == state(&alone));
    // With more samples each they learn from others.
    together(&four, 2);
    assert!(state(&one) != state(&four));
}
