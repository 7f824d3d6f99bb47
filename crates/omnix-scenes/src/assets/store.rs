//! Where the files of assets lie: in a folder, or in a ZIP archive. Names have `/` between their parts and begin below the root.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::File;
use std::io::{BufReader, Read as _};
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use crate::model::Flaw;

/// An archive holds fewer files than this.
const MOST_NAMES: usize = 200_000;

/// A folder or an archive with the names of all its files.
#[derive(Debug)]
pub(crate) struct Store {
    root: PathBuf,
    archive: bool,
    names: BTreeSet<String>,
    /// Names in lower case: files name each other without care for it.
    lower: BTreeMap<String, String>,
}

impl Store {
    /// All files in a folder and the folders below it. Links are not followed: they may lead in a circle.
    pub(crate) fn folder(root: &Path) -> Result<Self, (PathBuf, std::io::Error)> {
        let mut names = BTreeSet::new();
        let mut folders = vec![(root.to_owned(), String::new())];
        while let Some((folder, prefix)) = folders.pop() {
            let failed = |source| (folder.clone(), source);
            for entry in std::fs::read_dir(&folder).map_err(failed)? {
                let entry = entry.map_err(failed)?;
                let kind = entry.file_type().map_err(failed)?;
                // A name that is no Unicode could not be told to anybody.
                let Ok(name) = entry.file_name().into_string() else { continue };
                if kind.is_dir() {
                    folders.push((entry.path(), format!("{prefix}{name}/")));
                } else if kind.is_file() {
                    names.insert(format!("{prefix}{name}"));
                }
            }
        }
        Ok(Self::of(root, false, names))
    }

    /// All files in a ZIP archive.
    pub(crate) fn archive(path: &Path) -> Result<Self, Flaw> {
        let zip = open(path)?;
        if zip.len() > MOST_NAMES {
            return Err(Flaw::Broken(format!("it holds {} files, more than {MOST_NAMES}", zip.len())));
        }
        let names = zip.file_names().filter(|name| !name.ends_with('/')).map(str::to_owned).collect();
        Ok(Self::of(path, true, names))
    }

    fn of(root: &Path, archive: bool, names: BTreeSet<String>) -> Self {
        // Of names that differ in case alone the last one is found without care for it.
        let lower = names.iter().map(|name| (name.to_lowercase(), name.clone())).collect();
        Self { root: root.to_owned(), archive, names, lower }
    }

    /// Names that end, after a dot, in one of these (lower case), in their order.
    pub(crate) fn with_ending<'a>(&'a self, endings: &'a [&str]) -> impl Iterator<Item = &'a str> {
        self.names.iter().map(String::as_str).filter(move |name| endings.contains(&ending(name).as_str()))
    }

    /// The file that `from` means by a reference: beside it, or by steps up and down; nothing where there is no such file.
    pub(crate) fn find(&self, from: &str, reference: &str) -> Option<&str> {
        let reference = reference.trim().trim_matches('"').replace('\\', "/");
        let mut parts: Vec<&str> = from.split('/').collect();
        parts.pop();
        if reference.starts_with('/') {
            parts.clear();
        }
        for part in reference.split('/') {
            match part {
                "" | "." => {}
                // Nothing outside of the root is looked at.
                ".." => _ = parts.pop()?,
                part => parts.push(part),
            }
        }
        let name = parts.join("/");
        self.names.get(&name).or_else(|| self.lower.get(&name.to_lowercase())).map(String::as_str)
    }

    /// The bytes of a file, if there are no more than `most`.
    pub(crate) fn read(&self, name: &str, most: u64) -> Result<Vec<u8>, Flaw> {
        let failed = |error: std::io::Error| Flaw::Broken(error.to_string());
        let mut bytes = Vec::new();
        // What an archive says of a file's size is not believed.
        if self.archive {
            let mut zip = open(&self.root)?;
            let entry = zip.by_name(name).map_err(|error| Flaw::Broken(error.to_string()))?;
            entry.take(most + 1).read_to_end(&mut bytes).map_err(failed)?;
        } else {
            let file = File::open(self.root.join(name)).map_err(failed)?;
            file.take(most + 1).read_to_end(&mut bytes).map_err(failed)?;
        }
        if bytes.len() as u64 > most { Err(Flaw::Bytes { most }) } else { Ok(bytes) }
    }

    /// How people find the file: below the folder, or in the archive.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.root.join(name)
    }
}

/// What follows the last dot of a name, in lower case.
pub(crate) fn ending(name: &str) -> String {
    Path::new(name).extension().and_then(|end| end.to_str()).unwrap_or_default().to_ascii_lowercase()
}

fn open(path: &Path) -> Result<ZipArchive<BufReader<File>>, Flaw> {
    let file = File::open(path).map_err(|error| Flaw::Broken(error.to_string()))?;
    ZipArchive::new(BufReader::new(file)).map_err(|error| Flaw::Broken(error.to_string()))
}

#[cfg(test)]
mod tests {
    use std::io::Write as _;

    use super::*;

    #[test]
    fn files_are_found_beside_each_other_and_never_outside() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("all.zip");
        let mut zip = zip::ZipWriter::new(File::create(&path).unwrap());
        for name in ["a/chair.obj", "a/Chair.MTL", "b/wood.jpg"] {
            zip.start_file(name, zip::write::SimpleFileOptions::default()).unwrap();
            zip.write_all(name.as_bytes()).unwrap();
        }
        zip.finish().unwrap();
        std::fs::create_dir(folder.path().join("a")).unwrap();
        std::fs::write(folder.path().join("a/chair.mtl"), "a/Chair.MTL").unwrap();
        std::fs::create_dir(folder.path().join("b")).unwrap();
        std::fs::write(folder.path().join("b/wood.jpg"), "").unwrap();
        for store in [Store::archive(&path).unwrap(), Store::folder(folder.path()).unwrap()] {
            let found = store.find("a/chair.obj", "chair.mtl").unwrap();
            assert_eq!(store.read(found, 100).unwrap(), b"a/Chair.MTL");
            assert!(matches!(store.read(found, 5), Err(Flaw::Bytes { most: 5 })));
            assert_eq!(store.find("a/chair.obj", "..\\B\\wood.jpg"), Some("b/wood.jpg"));
            assert_eq!(store.find("a/chair.obj", "/b/wood.jpg"), Some("b/wood.jpg"));
            assert_eq!(store.find("a/chair.obj", "../../b/wood.jpg"), None);
            assert_eq!(store.with_ending(&["jpg"]).collect::<Vec<_>>(), ["b/wood.jpg"]);
        }
        std::fs::write(&path, "no archive").unwrap();
        assert!(matches!(Store::archive(&path), Err(Flaw::Broken(_))));
    }
}
