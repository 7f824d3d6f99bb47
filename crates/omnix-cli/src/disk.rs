//! Whether the disk has room for what a run would write: asked before any work.

use std::path::Path;

use omnix::io::{Export, RunSize};
use omnix::{FieldPrecision, RunPlan};

use crate::error::CliError;
use crate::windowing::{self, WindowSize};

/// Bytes that the exports of a run take, roughly and rather too many; with the pictures that wait in a file, and of a film in
/// windows, with what they say: depth, confidence and motion score of every pixel, of shared images twice; where points are followed or the field is saved, with the windows' fields.
pub(crate) fn wanted(exports: &[Export], size: &RunSize, plan: &RunPlan, windows: Option<WindowSize>) -> u64 {
    let waiting = size.images.saturating_mul(size.pixels).saturating_mul(if windows.is_some() { 3 + 24 } else { 3 });
    let saved = exports.contains(&Export::Field);
    let fields = windows.filter(|_| windowing::need_fields(exports)).map_or(0, |window| {
        let each = plan.motion.as_ref().map_or(0, |motion| FieldPrecision::F32.bytes(&motion.shape));
        // The last window of a film is moved back over the one before.
        let count = size.images.div_ceil((window.images - window.overlap) as u64);
        // Those that are saved may be copies; with them go the pictures.
        let pictures = size.images.saturating_mul(4 * size.pixels);
        each.saturating_mul(count).saturating_mul(if saved { 2 } else { 1 }).saturating_add(pictures)
    });
    let waiting = waiting.saturating_add(fields);
    let exports = exports.iter().fold(waiting, |sum, export| sum.saturating_add(export.disk_bytes(size)));
    // A field that does not fit the budget waits in a file of the same folder.
    exports.saturating_add(plan.motion.as_ref().filter(|m| !m.resident).map_or(0, |m| m.shape.bytes()))
}

/// An error if `dir` (which exists) has less room than `needed`.
pub(crate) fn check(dir: &Path, needed: u64) -> Result<(), CliError> {
    match free(dir) {
        Some(free) if free < needed => Err(CliError::DiskSpace { needed, free, dir: dir.to_owned() }),
        _ => Ok(()),
    }
}

/// An error if a software device could not hold a run of `plan`: Mesa's keeps its memory in a file of the system, and one that may not
/// grow ends the process without a word.
pub(crate) fn check_device_memory(plan: &RunPlan) -> Result<(), CliError> {
    let needed = plan.peak_bytes();
    match std::fs::read_to_string("/proc/self/limits").ok().and_then(|limits| file_limit(&limits)) {
        Some(limit) if limit < needed => Err(CliError::FileLimit { limit, needed }),
        _ => Ok(()),
    }
}

/// Bytes that a file of a process with these limits (Linux, proc(5)) may have; none where there is no limit.
fn file_limit(limits: &str) -> Option<u64> {
    limits.lines().find_map(|line| line.strip_prefix("Max file size"))?.split_whitespace().next()?.parse().ok()
}

/// Bytes that this user may still write there; none where the system does not say.
#[cfg(unix)]
fn free(dir: &Path) -> Option<u64> {
    let stat = rustix::fs::statvfs(dir).ok()?;
    Some(stat.f_bavail.saturating_mul(stat.f_frsize))
}

#[cfg(not(unix))]
fn free(_: &Path) -> Option<u64> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn limits_of_file_sizes() {
        let limits =
            |soft: &str| format!("Limit  Soft Limit  Hard Limit  Units\nMax file size  {soft}  unlimited  bytes\n");
        assert_eq!(file_limit(&limits("20480000")), Some(20_480_000));
        assert_eq!((file_limit(&limits("unlimited")), file_limit("")), (None, None));
    }

    #[test]
    fn more_than_the_disk_has_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        assert!(check(dir.path(), 0).is_ok());
        let refused = check(dir.path(), u64::MAX);
        assert!(cfg!(not(unix)) || matches!(refused, Err(CliError::DiskSpace { needed: u64::MAX, .. })), "{refused:?}");
    }
}
