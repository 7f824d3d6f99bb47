//! Which folders hold cases.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// A folder with recorded cases.
pub(crate) struct Folder {
    /// What its line is called.
    pub(crate) label: String,
    pub(crate) path: PathBuf,
}

impl Folder {
    /// The file `name` of the folder, if it is there.
    pub(crate) fn file(&self, name: &str) -> Option<PathBuf> {
        Some(self.path.join(name)).filter(|p| p.is_file())
    }

    /// All `case*.safetensors`, sorted.
    pub(crate) fn cases(&self) -> Vec<PathBuf> {
        let found: BTreeSet<PathBuf> = entries(&self.path)
            .into_iter()
            .filter(|p| {
                let name = p.file_name().unwrap_or_default().to_string_lossy().into_owned();
                name.starts_with("case") && name.ends_with(".safetensors")
            })
            .collect();
        found.into_iter().collect()
    }
}

fn entries(path: &Path) -> Vec<PathBuf> {
    let listed = std::fs::read_dir(path).map(|all| all.filter_map(|e| Some(e.ok()?.path())).collect());
    let mut paths: Vec<PathBuf> = listed.unwrap_or_default();
    paths.sort();
    paths
}

/// The repository's own folder of small cases.
pub(crate) fn repository() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/goldens")
}

/// Every case folder there is to check.
pub(crate) fn folders() -> Vec<Folder> {
    let shared = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared");
    let mut roots = vec![("repo", repository()), ("shared", shared.join("golden")), ("shared", shared.join("weights"))];
    let extra = std::env::var("OMNIX_GOLDEN").unwrap_or_default();
    roots.extend(extra.split(':').filter(|p| !p.is_empty()).map(|p| ("OMNIX_GOLDEN", PathBuf::from(p))));
    let mut out = Vec::new();
    for (label, root) in roots {
        let before = out.len();
        descend(&root, label, 3, &mut out);
        // A folder that was asked for and holds nothing is a mistake worth hearing of.
        if label == "OMNIX_GOLDEN" && out.len() == before {
            out.push(Folder { label: format!("{label}/{}", root.display()), path: root });
        }
    }
    out
}

/// Adds `path` if it holds cases, else looks into its folders.
fn descend(path: &Path, label: &str, depth: usize, out: &mut Vec<Folder>) {
    let folder = Folder { label: label.to_owned(), path: path.to_owned() };
    let tables = ["geometry", "raypose", "posembed", "preprocess", "resize"];
    if crate::eval::is_one(path)
        || !folder.cases().is_empty()
        || tables.iter().any(|t| folder.file(&format!("{t}.safetensors")).is_some())
    {
        out.push(folder);
        return;
    }
    if depth > 0 {
        for inner in entries(path).into_iter().filter(|p| p.is_dir()) {
            let name = inner.file_name().unwrap_or_default().to_string_lossy().into_owned();
            descend(&inner, &format!("{label}/{name}"), depth - 1, out);
        }
    }
}
