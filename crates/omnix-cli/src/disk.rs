//! Whether the disk has room for what a run would write: asked before any work.

use std::path::Path;

use omnix::io::Export;
use omnix::{FieldPrecision, RunPlan};

use crate::args::RunArgs;
use crate::error::CliError;
use crate::job::Job;

/// Bytes that the exports of a run take, roughly and rather too many: pictures and archives as if they did not shrink.
pub(crate) fn wanted(job: &Job, args: &RunArgs, plan: &RunPlan) -> u64 {
    let request = &job.request;
    let (images, pixels) = (request.images as u64, (request.height * request.width) as u64);
    let all = images * pixels;
    let followed = args.followed().min(all);
    let mut bytes = 0;
    for export in &job.exports {
        bytes += match export {
            Export::Npz | Export::MiniNpz => 11 * all,
            Export::Depth => 5 * all,
            Export::Ply => 19 * args.points.unwrap_or(all).min(all),
            Export::Glb if request.motion => followed * (20 + 12 * images.min(32)),
            Export::Glb => 16 * args.points.unwrap_or(1_000_000).min(all),
            Export::Tracks if args.all_tracks => all * (12 * images + 12),
            Export::Tracks => followed * (12 * images + 20),
            Export::St4rtrack => 2 * 28 * all,
            Export::Omx4d => followed.min(100_000) * (12 * images + 9),
            Export::Masks => 3 * all,
            // Base64 of six bytes a point and time.
            Export::Html => followed * (8 * images + 16) + images * 64_000 + (1 << 20),
            Export::Field => plan.motion.as_ref().map_or(0, |m| FieldPrecision::from(args.field_type).bytes(&m.shape)),
            _ => 0,
        };
    }
    // A field that does not fit the budget waits in a file of the same folder.
    bytes + plan.motion.as_ref().filter(|m| !m.resident).map_or(0, |m| m.shape.bytes())
}

/// An error if `dir` (which exists) has less room than `needed`.
pub(crate) fn check(dir: &Path, needed: u64) -> Result<(), CliError> {
    match free(dir) {
        Some(free) if free < needed => Err(CliError::DiskSpace { needed, free, dir: dir.to_owned() }),
        _ => Ok(()),
    }
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
    fn more_than_the_disk_has_is_refused() {
        let dir = tempfile::tempdir().unwrap();
        assert!(check(dir.path(), 0).is_ok());
        let refused = check(dir.path(), u64::MAX);
        assert!(cfg!(not(unix)) || matches!(refused, Err(CliError::DiskSpace { needed: u64::MAX, .. })), "{refused:?}");
    }
}
