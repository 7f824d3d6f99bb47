//! Time by the wall and by the processors.

use std::time::Instant;

/// Time since it was started: by the wall, and by the processors as [`Timing::cpu`](super::Timing::cpu) has it.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    start: Instant,
    cpu: Option<f64>,
}

impl Clock {
    /// Starts now.
    #[must_use]
    pub fn start() -> Self {
        Self { start: Instant::now(), cpu: cpu_seconds() }
    }

    /// Seconds by the wall, and of all threads of this process over the number of processors (Linux only).
    #[must_use]
    pub fn seconds(&self) -> (f64, Option<f64>) {
        let cpu = self.cpu.zip(cpu_seconds()).map(|(before, after)| (after - before) / processors() as f64);
        (self.start.elapsed().as_secs_f64(), cpu)
    }
}

/// Processors this process may use.
pub(super) fn processors() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}

/// Processor time of all threads of this process so far; `None` where the system has no /proc.
pub(super) fn cpu_seconds() -> Option<f64> {
    let mut nanoseconds = 0u64;
    for task in std::fs::read_dir("/proc/self/task").ok()? {
        // A thread may end meanwhile.
        let Ok(text) = std::fs::read_to_string(task.ok()?.path().join("schedstat")) else { continue };
        nanoseconds += text.split_whitespace().next()?.parse::<u64>().ok()?;
    }
    Some(nanoseconds as f64 * 1e-9)
}

/// Processor time of this thread so far, which the kernel brings up to date every few milliseconds.
pub(super) fn thread_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    Some(text.split_whitespace().next()?.parse::<u64>().ok()? as f64 * 1e-9)
}
