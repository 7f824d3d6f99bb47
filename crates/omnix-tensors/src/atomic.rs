//! Files that appear whole or not at all.

use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

/// A file written under a temporary name in its own folder; [`AtomicFile::commit`] gives it its name. Dropped before that, it leaves
/// nothing.
#[derive(Debug)]
pub struct AtomicFile {
    out: BufWriter<NamedTempFile>,
    path: PathBuf,
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
        builder.prefix(".omnix-").suffix(".part");
        #[cfg(unix)]
        {
            // Temporary files are private by default; results get what the user's umask allows.
            use std::os::unix::fs::PermissionsExt;
            builder.permissions(fs::Permissions::from_mode(0o666));
        }
        let file = builder.tempfile_in(folder)?;
        Ok(Self { out: BufWriter::with_capacity(1 << 20, file), path: path.to_owned() })
    }

    /// Empties the buffers, waits for the disk, and renames.
    ///
    /// # Errors
    /// As the system has them; then there is no file.
    pub fn commit(self) -> io::Result<PathBuf> {
        let path = self.path;
        let file = self.out.into_inner().map_err(io::IntoInnerError::into_error)?;
        file.as_file().sync_all()?;
        file.persist(&path).map_err(|e| e.error)?;
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
