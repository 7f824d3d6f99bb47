//! Files that appear whole or not at all.
//!
//! A file in the making has a temporary name and is locked by its writer. Its name is also kept in a list of this process, so that
//! [`abandon`] can remove it when the process has to end at once.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

/// How names of files in the making begin and end.
const BEGIN: &str = ".omnix-";
const END: &str = ".part";

/// Whether this is the name of a file in the making, or of one whose writer was killed. A writer that lives locks its file.
#[must_use]
pub fn is_unfinished(path: &Path) -> bool {
    let name = path.file_name().and_then(|name| name.to_str());
    name.is_some_and(|name| name.starts_with(BEGIN) && name.ends_with(END))
}

/// Files in the making.
static UNFINISHED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

fn unfinished() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    UNFINISHED.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Removes all files in the making; from now on none can be begun, given its name or given up. For a program that ends the
/// process next, while other threads may still be writing.
pub fn abandon() {
    let list = unfinished();
    for path in list.iter() {
        // The process ends, and there is nobody left to tell.
        let _ = fs::remove_file(path);
    }
    std::mem::forget(list);
}

/// The place of a file in the list of those in the making.
#[derive(Debug)]
struct Listed(PathBuf);

impl Drop for Listed {
    fn drop(&mut self) {
        unfinished().remove(&self.0);
    }
}

/// A file written under a temporary name in its own folder; [`AtomicFile::commit`] gives it its name. Dropped before that, it leaves
/// nothing.
#[derive(Debug)]
pub struct AtomicFile {
    out: BufWriter<NamedTempFile>,
    path: PathBuf,
    listed: Listed,
}

impl AtomicFile {
    /// Starts the file, making its folder.
    ///
    /// # Errors
    /// As the system has them.
    pub fn create(path: &Path) -> io::Result<Self> {
        let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
        fs::create_dir_all(folder)?;
        let mut builder = tempfile::Builder::new();
        builder.prefix(BEGIN).suffix(END);
        #[cfg(unix)]
        {
            // Temporary files are private by default; results get what the user's umask allows.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let mut list = unfinished();
        let file = builder.tempfile_in(folder)?;
        // The lock tells a later run that this one lives. Not every file system has locks.
        let _ = file.as_file().try_lock();
        let listed = Listed(file.path().to_owned());
        list.insert(listed.0.clone());
        drop(list);
        Ok(Self { out: BufWriter::with_capacity(1 << 20, file), path: path.to_owned(), listed })
    }

    /// Where it lies until then, for another program to write to.
    #[must_use]
    pub fn temporary(&self) -> &Path {
        &self.listed.0
    }

    /// Empties the buffers, waits for the disk, and renames.
    ///
    /// # Errors
    /// As the system has them; then there is no file.
    pub fn commit(self) -> io::Result<PathBuf> {
        let Self { out, path, listed } = self;
        let file = out.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.as_file().sync_all()?;
        file.persist(&path).map_err(|e| e.error)?;
        drop(listed);
        // The rename itself is durable once the folder is; not every file system offers that, and the file is whole anyway.
        if let Some(folder) = path.parent() {
            let _ = File::open(folder).and_then(|f| f.sync_all());
        }
        Ok(path)
    }
}

impl Write for AtomicFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

impl Seek for AtomicFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.out.seek(to)
    }
}
