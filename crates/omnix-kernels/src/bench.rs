//! Measuring: the time of recorded dispatches on a device, and the ceilings of the machine to compare it with.
//!
//! A run repeats the dispatches inside one submission until it takes about [`Effort::run`], so that the cost of a
//! submission does not count; inputs are warm after the first run. Times are in seconds.

mod ceilings;
mod clock;

use std::time::{Duration, Instant};

pub use ceilings::Ceilings;
pub use clock::Clock;
use clock::{cpu_seconds, processors};

use crate::{BufferSlice, Dispatch, Gpu, KernelError, Program};

/// How long to measure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Effort {
    /// Measured runs after the warm-up; the median counts.
    pub runs: usize,
    /// What one run should take at least.
    pub run: Duration,
}

impl Effort {
    /// Enough for a table: 5 runs of a tenth of a second.
    pub const TABLE: Self = Self { runs: 5, run: Duration::from_millis(100) };
    /// One run of one repetition: only shows that it works.
    pub const ONCE: Self = Self { runs: 1, run: Duration::ZERO };
}

/// The time of one repetition.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Timing {
    /// Median over the runs, wall clock.
    pub wall: f64,
    /// Median over the runs of the processor time of all threads of this process, divided by the number of
    /// processors: what the wall clock would show on an idle machine, for software devices. Linux only.
    pub cpu: Option<f64>,
    /// The first repetition, with the driver's compilation.
    pub first: f64,
    /// Repetitions of each run.
    pub repeats: usize,
}

/// Measures `dispatches` over `args` on `gpu`.
///
/// # Errors
/// When a pipeline cannot be made, memory runs out or the device is lost.
pub fn time(gpu: &Gpu, dispatches: &[Dispatch], args: &[BufferSlice], effort: Effort) -> Result<Timing, KernelError> {
    let program = Program::new(gpu, dispatches.iter().map(|d| (d, args)))?;
    let run = |repeats: usize| -> Result<(f64, Option<f64>), KernelError> {
        let (start, cpu) = (Instant::now(), cpu_seconds());
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            for _ in 0..repeats {
                program.encode(&mut pass, 0..program.len());
            }
        }
        gpu.queue.submit([encoder.finish()]);
        gpu.wait()?;
        let per = |seconds: f64| seconds / repeats as f64;
        let wall = per(start.elapsed().as_secs_f64());
        Ok((wall, cpu.zip(cpu_seconds()).map(|(before, after)| per(after - before) / processors() as f64)))
    };
    let (first, _) = run(1)?;
    // The second repetition is warm: it says how many fill a run.
    let once = if effort.run.is_zero() { first } else { run(1)?.0 };
    let repeats = (effort.run.as_secs_f64() / once.max(1e-9)).ceil().clamp(1.0, 10_000.0) as usize;
    let runs = (0..effort.runs.max(1)).map(|_| run(repeats)).collect::<Result<Vec<_>, _>>()?;
    let wall = median(runs.iter().map(|r| r.0).collect());
    let cpu = runs.iter().map(|r| r.1).collect::<Option<Vec<f64>>>().map(median);
    Ok(Timing { wall, cpu, first, repeats })
}

/// The middle one, or the lower of the two in the middle.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[(values.len() - 1) / 2]
}

#[cfg(test)]
mod tests {
    use super::median;

    #[test]
    fn the_median_is_one_of_the_values() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 3.0, 2.0]), 2.0);
        assert_eq!(median(vec![7.0]), 7.0);
    }
}
