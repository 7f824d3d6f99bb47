//! The files of the repository: what the text files hold, read once, and the size of all of them.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use crate::XtaskError;

/// Folders that hold no text of ours: build output, program output.
const SKIPPED: [&str; 2] = ["target", "out"];
/// Hidden folders are skipped, but for these.
const HIDDEN: [&str; 4] = [".cargo", ".ci", ".config", ".github"];
/// Endings of the files that are read. Files without an ending are scripts; they are read in `tools` and `.ci`.
const ENDINGS: [&str; 6] = ["md", "py", "rs", "toml", "wgsl", "yml"];

/// Paths relative to the root, with `/`, and what the files hold.
#[derive(Debug, Default, Clone)]
pub struct Tree {
    files: BTreeMap<String, String>,
    sizes: BTreeMap<String, u64>,
}

impl Tree {
    /// Reads the files below `root`.
    ///
    /// # Errors
    /// [`XtaskError::Read`] naming the file or folder.
    pub fn read(root: &Path) -> Result<Self, XtaskError> {
        let mut tree = Self::default();
        tree.read_folder(root, "")?;
        Ok(tree)
    }

    /// A tree from pairs of path and text, for tests of the checks.
    pub fn from_files<'a>(files: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let files: BTreeMap<String, String> =
            files.into_iter().map(|(path, text)| (path.to_owned(), text.to_owned())).collect();
        let sizes = files.iter().map(|(path, text)| (path.clone(), text.len() as u64)).collect();
        Self { files, sizes }
    }

    /// A tree of files that only have sizes, in bytes, for tests of the checks.
    pub fn from_sizes<'a>(sizes: impl IntoIterator<Item = (&'a str, u64)>) -> Self {
        let sizes = sizes.into_iter().map(|(path, bytes)| (path.to_owned(), bytes)).collect();
        Self { files: BTreeMap::new(), sizes }
    }

    /// The size in bytes of all files, texts or not, sorted by path.
    pub fn sizes(&self) -> impl Iterator<Item = (&str, u64)> {
        self.sizes.iter().map(|(path, bytes)| (path.as_str(), *bytes))
    }

    /// All text files, sorted by path.
    pub fn files(&self) -> impl Iterator<Item = (&str, &str)> {
        self.files.iter().map(|(path, text)| (path.as_str(), text.as_str()))
    }

    /// Is there a file at this path?
    pub fn has(&self, path: &str) -> bool {
        self.files.contains_key(path)
    }

    /// Stems of the Rust files that lie directly in `folder`.
    pub fn rust_stems(&self, folder: &str) -> impl Iterator<Item = &str> {
        self.files.keys().filter_map(move |path| {
            let stem = path.strip_prefix(folder)?.strip_prefix('/')?.strip_suffix(".rs")?;
            (!stem.contains('/')).then_some(stem)
        })
    }

    /// Names of the folders directly in `folder` that hold a file at any depth.
    pub fn folders(&self, folder: &str) -> Vec<&str> {
        let inside = self.files.keys().filter_map(|path| path.strip_prefix(folder)?.strip_prefix('/')?.split_once('/'));
        let mut names: Vec<&str> = inside.map(|(name, _)| name).collect();
        names.dedup();
        names
    }

    fn read_folder(&mut self, folder: &Path, prefix: &str) -> Result<(), XtaskError> {
        let failed = |source| XtaskError::Read { path: folder.to_owned(), source };
        for entry in fs::read_dir(folder).map_err(failed)? {
            let entry = entry.map_err(failed)?;
            let kind = entry.file_type().map_err(failed)?;
            // A name that is not UTF-8 is none of ours.
            let Ok(name) = entry.file_name().into_string() else {
                continue;
            };
            let relative = if prefix.is_empty() { name.clone() } else { format!("{prefix}/{name}") };
            if kind.is_dir() {
                let hidden = name.starts_with('.') && !HIDDEN.contains(&name.as_str());
                if !hidden && !SKIPPED.contains(&name.as_str()) {
                    self.read_folder(&entry.path(), &relative)?;
                }
            } else if kind.is_file() {
                let failed = |source| XtaskError::Read { path: entry.path(), source };
                let Some(metadata) = there(entry.metadata()).map_err(failed)? else {
                    continue;
                };
                self.sizes.insert(relative.clone(), metadata.len());
                if is_text(&relative, &name)
                    && let Some(text) = there(fs::read_to_string(entry.path())).map_err(failed)?
                {
                    self.files.insert(relative, text);
                }
            }
        }
        Ok(())
    }
}

/// `None` for a file that is not there: an editor's temporary one that went away meanwhile.
fn there<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(error),
    }
}

fn is_text(path: &str, name: &str) -> bool {
    match name.rsplit_once('.') {
        Some((_, ending)) => ENDINGS.contains(&ending),
        None => path.starts_with("tools/") || path.starts_with(".ci/"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_stems_and_folders_of_one_level() {
        let tree = Tree::from_files([
            ("a/b/deep.rs", ""),
            ("a/c/x.rs", ""),
            ("a/one.rs", ""),
            ("ab/two.rs", ""),
            ("a/note.md", ""),
        ]);
        assert_eq!(tree.rust_stems("a").collect::<Vec<_>>(), ["one"]);
        assert_eq!(tree.folders("a"), ["b", "c"]);
    }

    #[test]
    fn reads_this_file() {
        let tree = Tree::read(crate::root()).unwrap();
        assert!(tree.has("tools/xtask/src/tree.rs"));
        assert!(tree.has("tools/setup"), "scripts have no ending");
        assert!(tree.sizes().any(|(path, _)| path == "Cargo.lock"), "every file has a size");
        assert!(tree.files().all(|(path, _)| !path.starts_with("target/") && !path.starts_with(".git/")));
    }
}
