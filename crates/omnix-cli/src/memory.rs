//! Memory of the machine: what a run may take, and what its process takes, where that is the device's too
//! (Mesa's lavapipe and other software devices).
//!
//! The plan is what the device holds, to the byte. Beside it lie the program, the driver with its compiler and compiled kernels, the
//! pictures, and followed points while a file is put together. These were measured (BENCHMARKS.md, "Memory,
//! and the release size": 3 networks, 1 to 24 images, every export) and are stated here as they were found. A first run, when
//! the driver's cache of compiled kernels is empty, takes about 150 MiB more, and 100 for each of up to two more processors that compile.

use omnix::io::Export;
use omnix::{RunPlan, Tier};

use crate::args::RunArgs;

/// The program, the driver, its compiler and the kernels of the geometry network, made on several threads.
const PROGRAM: u64 = 131 << 20;
/// The kernels of the trajectory module and its sampling head, and what its stages leave behind.
const MOTION: u64 = 30 << 20;

/// What the process will hold at most; none on a GPU, which has memory of its own.
pub(crate) fn process(plan: &RunPlan, exports: &[Export], args: &RunArgs, tier: Tier) -> Option<u64> {
    if tier == Tier::Gpu {
        return None;
    }
    let request = &plan.request;
    let pixels = (request.images * request.height * request.width) as u64;
    let followed = args.followed().min(pixels);
    // Positions of the followed points at all times; how often an export holds them, in quarters.
    let path_bytes = followed * 12 * request.images as u64;
    let quarters = |export: &Export| match export {
        Export::Html | Export::Tracks => 5,
        Export::Glb if request.motion => 8,
        Export::Omx4d => 9,
        _ => 0,
    };
    let largest = exports.iter().map(quarters).max().unwrap_or(0);
    let motion = if request.motion { MOTION } else { 0 };
    Some(PROGRAM + motion + plan.peak_bytes() + 3 * pixels + path_bytes / 4 * largest)
}

/// The most that this process has held so far; none where the system does not say (other systems than Linux).
pub(crate) fn peak() -> Option<u64> {
    stated("/proc/self/status", "VmHWM:")
}

/// What the system could give now; none where it does not say.
pub(crate) fn available() -> Option<u64> {
    stated("/proc/meminfo", "MemAvailable:")
}

/// Bytes in the line of `file` that begins with `name`.
fn stated(file: &str, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find(|l| l.starts_with(name))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib << 10)
}
