//! The text files of the repository, read once.

use std::collections::BTreeMap;
use std::fs;
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
        let files = files.into_iter().map(|(path, text)| (path.to_owned(), text.to_owned())).collect();
        Self { files }
    }

    /// All files, sorted by path.
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
            } else if kind.is_file() && is_text(&relative, &name) {
                match fs::read_to_string(entry.path()) {
                    Ok(text) => _ = self.files.insert(relative, text),
                    // An editor's temporary file that went away meanwhile.
                    Err(error) if error.kind() == std::io::ErrorKind::NotFound => {}
                    Err(source) => {
                        return Err(XtaskError::Read { path: entry.path(), source });
                    }
                }
            }
        }
        Ok(())
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
        assert!(tree.files().all(|(path, _)| !path.starts_with("target/") && !path.starts_with(".git/")));
    }
}
