//! One pass over a checkpoint's files: their digest, and what keeps numbers from being used, while each byte goes by once.
//!
//! Several may ask for it at a time: one does the work, the others wait and are told how far it is.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Duration;

use omnix_tensors::{Findings, TensorFile};

/// How often those who wait tell of progress.
const WAIT: Duration = Duration::from_millis(50);

/// What the pass found.
#[derive(Debug)]
pub struct Verified {
    digest: String,
    /// By file and full name: tensors with numbers that cannot be used, or not as f16.
    findings: BTreeMap<(usize, String), Findings>,
}

impl Verified {
    /// BLAKE3 of the weight files' bytes, one after the other in the order of their names, as lower-case hexadecimal.
    #[must_use]
    pub fn digest(&self) -> &str {
        &self.digest
    }

    /// Tensors with numbers that cannot be used, or not as f16: full names in their order, file by file.
    pub fn findings(&self) -> impl Iterator<Item = (&str, Findings)> {
        self.findings.iter().map(|((_, name), found)| (name.as_str(), *found))
    }

    /// What was found in a tensor of a file.
    pub(crate) fn of(&self, file: usize, name: &str) -> Findings {
        self.findings.get(&(file, name.to_owned())).copied().unwrap_or_default()
    }
}

/// The pass, done or not.
#[derive(Debug, Default)]
pub(crate) struct Verification {
    result: OnceLock<Verified>,
    /// Whether somebody is at it.
    busy: Mutex<bool>,
    ended: Condvar,
    /// Bytes that have gone by.
    done: AtomicU64,
}

impl Verification {
    /// The result, if there is one already.
    pub(crate) fn get(&self) -> Option<&Verified> {
        self.result.get()
    }

    /// The result, by doing the work or waiting for who does it; none if `progress`, which is told bytes done and in all, broke off.
    pub(crate) fn run(
        &self,
        files: &[TensorFile],
        progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>,
    ) -> Option<&Verified> {
        let total = files.iter().map(TensorFile::byte_len).sum();
        let mut busy = self.lock();
        loop {
            if let Some(found) = self.result.get() {
                return Some(found);
            }
            if !*busy {
                break;
            }
            busy = self.ended.wait_timeout(busy, WAIT).unwrap_or_else(PoisonError::into_inner).0;
            if progress(self.done.load(Ordering::Relaxed), total).is_break() {
                return None;
            }
        }
        *busy = true;
        drop(busy);
        let ended = Ended(self);
        let found = pass(files, &mut |done| {
            self.done.store(done, Ordering::Relaxed);
            progress(done, total)
        });
        if let ControlFlow::Continue(found) = found {
            let _ = self.result.set(found);
        }
        drop(ended);
        self.result.get()
    }

    fn lock(&self) -> MutexGuard<'_, bool> {
        self.busy.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Lets the next one go on, also after a panic.
struct Ended<'a>(&'a Verification);

impl Drop for Ended<'_> {
    fn drop(&mut self) {
        *self.0.lock() = false;
        self.0.ended.notify_all();
    }
}

/// Hashes the files and looks at the numbers of each piece while it is in the processor's cache.
fn pass(files: &[TensorFile], done: &mut dyn FnMut(u64) -> ControlFlow<()>) -> ControlFlow<(), Verified> {
    let mut hasher = blake3::Hasher::new();
    let mut findings: BTreeMap<(usize, String), Findings> = BTreeMap::new();
    let mut bytes = 0;
    for (index, file) in files.iter().enumerate() {
        file.in_pieces(&mut |piece| {
            let (_, found) = rayon::join(|| hasher.update_rayon(piece.bytes).count(), || piece.examine());
            for (name, found) in found {
                let all = findings.entry((index, name.to_owned())).or_default();
                *all = all.and(0, found);
            }
            bytes += piece.bytes.len() as u64;
            done(bytes)
        })?;
    }
    ControlFlow::Continue(Verified { digest: hasher.finalize().to_hex().to_string(), findings })
}
