//! The output folder of a run: proved to be writable, held against other runs, cleared of what killed runs left, and checked
//! when the run ends.
//!
//! The hold is the system's lock on the folder itself (on Windows on a file in it), so it ends with the process however that
//! ends. File systems without locks are used without one.

use std::collections::BTreeSet;
use std::fs::{self, File, TryLockError};
use std::path::{Path, PathBuf};

use omnix_tensors::is_unfinished;

use super::atomic::check_output_folder;
use super::export::{Export, is_part_folder};
use super::manifest::MANIFEST;
use crate::IoError;

/// The folder, in the output folder, of what the windows of a film said while the film is not whole: `NNNNNN.safetensors`, `NNNNNN.field.safetensors`.
pub const WINDOWS: &str = "windows";

/// A folder that this run alone writes to.
#[derive(Debug)]
pub struct OutputFolder {
    dir: PathBuf,
    _hold: Option<File>,
}

impl OutputFolder {
    /// Makes the folder, proves that a file can be written in it, takes hold of it, and removes temporary files of runs that
    /// were killed. Results of earlier runs stay as they are.
    ///
    /// # Errors
    /// The folder cannot be made or written to, or another run holds it.
    pub fn open(dir: &Path) -> Result<Self, IoError> {
        check_output_folder(dir)?;
        let hold = hold(dir)?;
        for folder in folders(dir) {
            remove_unfinished(&folder);
        }
        Ok(Self { dir: dir.to_owned(), _hold: hold })
    }

    /// Begins to write: an earlier run's manifest goes first, so that it never describes files of this one.
    ///
    /// # Errors
    /// It cannot be removed.
    pub fn begin(&self) -> Result<(), IoError> {
        let manifest = self.dir.join(MANIFEST);
        match fs::remove_file(&manifest) {
            Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(IoError::write(manifest, error)),
            _ => Ok(()),
        }
    }

    /// Removes what the windows of a film said: nothing needs it when a run is complete. Other files are left alone.
    pub fn remove_windows(&self) {
        let folder = self.dir.join(WINDOWS);
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let number = name.to_str().and_then(|name| name.strip_suffix(".safetensors"));
            let number = number.map(|number| number.strip_suffix(".field").unwrap_or(number));
            if number.is_some_and(|number| number.len() >= 6 && number.bytes().all(|b| b.is_ascii_digit())) {
                // What cannot be removed takes room and harms nothing.
                let _ = fs::remove_file(entry.path());
            }
        }
        let _ = fs::remove_dir(&folder);
    }

    /// Files that exports leave and that are not among `written`: those of an earlier run. Sorted, from the output folder.
    #[must_use]
    pub fn of_earlier_runs(&self, written: &[PathBuf]) -> Vec<String> {
        let written: BTreeSet<&Path> = written.iter().map(PathBuf::as_path).collect();
        let mut found = Vec::new();
        for folder in folders(&self.dir) {
            for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
                let path = entry.path();
                let Some(name) = path.strip_prefix(&self.dir).ok().and_then(Path::to_str) else { continue };
                let name = name.replace(std::path::MAIN_SEPARATOR, "/");
                if Export::leaves(&name) && !written.contains(path.as_path()) {
                    found.push(name);
                }
            }
        }
        found.sort_unstable();
        found
    }

    /// Checks that all these files are there: somebody may have removed the folder while the run went on.
    ///
    /// # Errors
    /// The first that is not.
    pub fn check<'a>(&self, written: impl IntoIterator<Item = &'a Path>) -> Result<(), IoError> {
        let missing = written.into_iter().find(|path| !path.is_file());
        missing.map_or(Ok(()), |path| Err(IoError::Vanished { path: path.to_owned() }))
    }
}

/// Every folder in which exports leave files, of the whole and of parts.
fn folders(dir: &Path) -> BTreeSet<PathBuf> {
    let is_part = |entry: &fs::DirEntry| entry.file_name().to_str().is_some_and(is_part_folder);
    let parts = fs::read_dir(dir).into_iter().flatten().flatten().filter(is_part).map(|entry| entry.path());
    let of = |dir: PathBuf| {
        let inside: Vec<PathBuf> =
            Export::ALL.iter().flat_map(|export| export.folders()).map(|f| dir.join(f)).collect();
        inside.into_iter().chain([dir])
    };
    parts.chain([dir.to_owned()]).flat_map(of).chain([dir.join(WINDOWS)]).collect()
}

/// Removes temporary files whose writers are gone: those that nobody locks.
fn remove_unfinished(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if !is_unfinished(&path) {
            continue;
        }
        let free = File::options().write(true).open(&path).is_ok_and(|file| file.try_lock().is_ok());
        // One that cannot be removed is no reason not to run.
        let _ = if free { fs::remove_file(&path) } else { Ok(()) };
    }
}

fn hold(dir: &Path) -> Result<Option<File>, IoError> {
    #[cfg(unix)]
    let handle = File::open(dir);
    // A folder cannot be opened there as a file is.
    #[cfg(not(unix))]
    let handle = File::options().create(true).write(true).truncate(false).open(dir.join(".omnix.lock"));
    let Ok(handle) = handle else { return Ok(None) };
    match handle.try_lock() {
        Ok(()) => Ok(Some(handle)),
        Err(TryLockError::WouldBlock) => Err(IoError::FolderInUse { path: dir.to_owned() }),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::atomic::AtomicFile;

    #[test]
    fn one_run_at_a_time() {
        let dir = tempfile::tempdir().unwrap();
        let first = OutputFolder::open(dir.path()).unwrap();
        let second = OutputFolder::open(dir.path()).unwrap_err();
        assert!(matches!(second, IoError::FolderInUse { .. }), "{second:?}");
        drop(first);
        OutputFolder::open(dir.path()).unwrap();
    }

    #[test]
    fn what_killed_runs_left_goes_and_what_is_being_written_stays() {
        let dir = tempfile::tempdir().unwrap();
        let depth = dir.path().join("depth");
        fs::create_dir(&depth).unwrap();
        let left = [dir.path().join(".omnix-a1b2.part"), depth.join(".omnix-c3d4.part")];
        left.iter().for_each(|path| fs::write(path, "half").unwrap());
        let other = dir.path().join(".omnix-notes");
        fs::write(&other, "mine").unwrap();
        let living = AtomicFile::create(dir.path().join("query.npz")).unwrap();
        OutputFolder::open(dir.path()).unwrap();
        assert!(left.iter().all(|path| !path.exists()) && other.exists());
        living.commit().unwrap();
    }

    #[test]
    fn what_windows_said_goes_and_what_is_beside_it_stays() {
        let dir = tempfile::tempdir().unwrap();
        let windows = dir.path().join(WINDOWS);
        fs::create_dir(&windows).unwrap();
        for name in [
            "000000.safetensors",
            "000000.field.safetensors",
            "1234567.safetensors",
            "mine.safetensors",
            ".omnix-a1b2.part",
        ] {
            fs::write(windows.join(name), "x").unwrap();
        }
        let folder = OutputFolder::open(dir.path()).unwrap();
        assert!(!windows.join(".omnix-a1b2.part").exists(), "a half file of a killed run");
        folder.remove_windows();
        assert!(windows.join("mine.safetensors").exists() && !windows.join("000000.safetensors").exists());
        assert!(!windows.join("000000.field.safetensors").exists());
        fs::remove_file(windows.join("mine.safetensors")).unwrap();
        folder.remove_windows();
        assert!(!windows.exists());
    }

    #[test]
    fn files_of_an_earlier_run_are_known_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let names = [
            "depth/000000.png",
            "depth/000001.png",
            "scene.glb",
            "mine.txt",
            "depth/mine.png",
            "part_001/tracks.csv",
            "part_of_mine/tracks.csv",
            MANIFEST,
        ];
        for name in names {
            let path = dir.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, "x").unwrap();
        }
        let folder = OutputFolder::open(dir.path()).unwrap();
        folder.begin().unwrap();
        assert!(!dir.path().join(MANIFEST).exists());
        let written = [dir.path().join("depth/000000.png")];
        assert_eq!(folder.of_earlier_runs(&written), ["depth/000001.png", "part_001/tracks.csv", "scene.glb"]);
        folder.check([written[0].as_path()]).unwrap();
        fs::remove_dir_all(dir.path().join("depth")).unwrap();
        assert!(matches!(folder.check([written[0].as_path()]), Err(IoError::Vanished { .. })));
    }
}
