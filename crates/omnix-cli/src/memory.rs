//! Memory of the machine: what a run may take, and what its process takes, where that is the device's too
//! (Mesa's lavapipe and other software devices).
//!
//! The plan is what the device holds, to the byte. Beside it lie the program, the driver with its compiler and compiled kernels, the
//! pictures, and followed points while a file is put together. These were measured (BENCHMARKS.md, "Memory,
//! and the release size": 3 networks, 1 to 24 images, every export) and are stated here as they were found. A first run, when
//! the driver's cache of compiled kernels is empty, takes about 150 MiB more, and 100 for each of up to two more processors that compile.

use std::path::{Path, PathBuf};

use omnix::io::{Export, RunSize};
use omnix::{RunPlan, Tier};

use crate::args::RunArgs;

/// The program, the driver, its compiler and the kernels of the geometry network, made on several threads.
const PROGRAM: u64 = 131 << 20;
/// The kernels of the trajectory module and its sampling head, and what its stages leave behind.
const MOTION: u64 = 30 << 20;

/// What the process will hold at most; none on a GPU, which has memory of its own. `reading` is what decoding the largest picture
/// takes: pictures are read before the device holds anything.
pub(crate) fn process(plan: &RunPlan, exports: &[Export], size: &RunSize, tier: Tier, reading: u64) -> Option<u64> {
    if tier == Tier::Gpu {
        return None;
    }
    let largest = exports.iter().map(|export| export.memory_bytes(size)).max().unwrap_or(0);
    // Exports of motion hold all pictures; else they wait in a file.
    let (motion, pictures) = if size.motion { (MOTION, 3 * size.images * size.pixels) } else { (0, 0) };
    let held = plan.peak_bytes().max(reading) + plan.host_bytes();
    Some(PROGRAM + motion + held + pictures + largest)
}

/// What decoding one picture may take: on a device that shares the machine's memory what was asked for, else 80 % of what is
/// free. `running` is false for a plan, which the machine's free memory does not bound.
pub(crate) fn for_pictures(args: &RunArgs, tier: Tier, running: bool) -> Option<u64> {
    let asked = args.memory_budget.filter(|_| tier != Tier::Gpu);
    asked.or_else(|| available().filter(|_| running).map(|free| free / 5 * 4))
}

/// The most that this process has held so far; none where the system does not say (other systems than Linux).
pub(crate) fn peak() -> Option<u64> {
    stated(Path::new("/proc/self/status"), "VmHWM:")
}

/// What the system could give now: to the machine, and to this process's control group (a container, a slurm job); none where it
/// does not say.
pub(crate) fn available() -> Option<u64> {
    available_under(Path::new("/"))
}

fn available_under(root: &Path) -> Option<u64> {
    let machine = stated(&root.join("proc/meminfo"), "MemAvailable:");
    [machine, group_room(root)].into_iter().flatten().min()
}

/// What the control group and those above it leave (Linux, cgroup-v2.rst and cgroup-v1/memory.rst): limit less use, of which
/// unused cached files count as free.
fn group_room(root: &Path) -> Option<u64> {
    let groups = std::fs::read_to_string(root.join("proc/self/cgroup")).ok()?;
    let number = |path: PathBuf| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let mut least = None;
    for line in groups.lines() {
        let mut fields = line.splitn(3, ':').skip(1);
        let (Some(controllers), Some(own)) = (fields.next(), fields.next()) else { continue };
        let (base, limit, used) = match controllers {
            "" => ("sys/fs/cgroup", "memory.max", "memory.current"),
            list if list.split(',').any(|c| c == "memory") => {
                ("sys/fs/cgroup/memory", "memory.limit_in_bytes", "memory.usage_in_bytes")
            }
            _ => continue,
        };
        // In a container the file system begins at its own group, whatever its name outside.
        for group in Path::new(own.trim_start_matches('/')).ancestors() {
            let folder = root.join(base).join(group);
            // "max" is no number: there is no limit.
            let Some(limit) = number(folder.join(limit)) else { continue };
            let cached = std::fs::read_to_string(folder.join("memory.stat")).ok().and_then(|stat| {
                stat.lines().find_map(|line| line.strip_prefix("inactive_file "))?.trim().parse::<u64>().ok()
            });
            let held = number(folder.join(used)).unwrap_or(0).saturating_sub(cached.unwrap_or(0));
            let room = limit.saturating_sub(held);
            least = Some(least.map_or(room, |least: u64| least.min(room)));
        }
    }
    least
}

/// Bytes in the line of `file` that begins with `name`.
fn stated(file: &Path, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find(|l| l.starts_with(name))?;
    let kib: u64 = line.split_whitespace().nth(1)?.parse().ok()?;
    Some(kib << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A system of these files.
    fn system(files: &[(&str, &str)]) -> tempfile::TempDir {
        let root = tempfile::tempdir().unwrap();
        for (name, text) in files {
            let path = root.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, text).unwrap();
        }
        root
    }

    const MACHINE: (&str, &str) = ("proc/meminfo", "MemTotal: 9000 kB\nMemAvailable: 8192 kB\n");

    #[test]
    fn the_tightest_group_counts() {
        let own = ("proc/self/cgroup", "0::/job/step\n");
        let free = system(&[MACHINE, own, ("sys/fs/cgroup/job/memory.max", "max\n")]);
        assert_eq!(available_under(free.path()), Some(8 << 20));
        let limited = system(&[
            MACHINE,
            own,
            ("sys/fs/cgroup/job/memory.max", "4194304\n"),
            ("sys/fs/cgroup/job/memory.current", "2097152\n"),
            ("sys/fs/cgroup/job/memory.stat", "anon 1048576\ninactive_file 1048576\n"),
            ("sys/fs/cgroup/job/step/memory.max", "max\n"),
        ]);
        assert_eq!(available_under(limited.path()), Some(3 << 20));
        let first = system(&[
            MACHINE,
            ("proc/self/cgroup", "5:cpu:/x\n4:memory:/docker/1\n"),
            ("sys/fs/cgroup/memory/memory.limit_in_bytes", "1048576\n"),
        ]);
        assert_eq!(available_under(first.path()), Some(1 << 20), "version 1, in a container");
    }

    #[test]
    fn nothing_is_known_where_the_system_does_not_say() {
        assert_eq!(available_under(system(&[]).path()), None);
    }
}
