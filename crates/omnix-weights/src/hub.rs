//! Checkpoints that lie in the Hugging Face hub's cache on this machine, by the names of their repositories. Nothing is downloaded.
//!
//! The cache (`huggingface_hub`, "Manage the cache-system"): `models--OWNER--NAME/refs/main` holds the digest of a revision, and
//! `snapshots/REVISION/` its files, as links to `blobs/`.

use std::ffi::OsString;
use std::path::{Path, PathBuf};

use crate::published;

/// The folder of the newest revision of a repository in the cache, if `name` can be that of one and it is there; and where it was looked
/// for.
pub(crate) fn find(name: &str) -> Option<Result<PathBuf, PathBuf>> {
    let repository = published::repository(name)?;
    let cache = cache(&|name| std::env::var_os(name).filter(|value| !value.is_empty()))?;
    Some(in_cache(&cache, &repository))
}

/// The cache's folder, by the environment's variables as the hub's own library reads them.
fn cache(variable: &dyn Fn(&str) -> Option<OsString>) -> Option<PathBuf> {
    let below = |name: &str, rest: &str| variable(name).map(|folder| Path::new(&folder).join(rest));
    variable("HF_HUB_CACHE")
        .map(PathBuf::from)
        .or_else(|| below("HF_HOME", "hub"))
        .or_else(|| below("XDG_CACHE_HOME", "huggingface/hub"))
        .or_else(|| below("HOME", ".cache/huggingface/hub"))
        .or_else(|| below("USERPROFILE", ".cache/huggingface/hub"))
}

fn in_cache(cache: &Path, repository: &str) -> Result<PathBuf, PathBuf> {
    let folder = cache.join(format!("models--{}", repository.replace('/', "--")));
    let snapshots = folder.join("snapshots");
    // The revision is a name of the cache's own; whatever else stands there leads nowhere.
    let named = std::fs::read_to_string(folder.join("refs/main")).ok();
    let revision = named
        .as_deref()
        .map(str::trim)
        .filter(|text| !text.is_empty() && text.chars().all(|c| c.is_ascii_alphanumeric()));
    match revision.map(|revision| snapshots.join(revision)).filter(|path| path.is_dir()) {
        Some(found) => Ok(found),
        None => Err(folder),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cache_is_where_the_hub_keeps_it() {
        let with = |pairs: &[(&str, &str)]| {
            let pairs: Vec<(String, OsString)> = pairs.iter().map(|(k, v)| ((*k).to_owned(), v.into())).collect();
            cache(&move |name| pairs.iter().find(|(k, _)| k == name).map(|(_, v)| v.clone()))
        };
        let home = ("HOME", "/home/x");
        assert_eq!(with(&[home]), Some("/home/x/.cache/huggingface/hub".into()));
        assert_eq!(with(&[home, ("XDG_CACHE_HOME", "/c")]), Some("/c/huggingface/hub".into()));
        assert_eq!(with(&[home, ("XDG_CACHE_HOME", "/c"), ("HF_HOME", "/h")]), Some("/h/hub".into()));
        assert_eq!(with(&[home, ("HF_HOME", "/h"), ("HF_HUB_CACHE", "/b")]), Some("/b".into()));
        assert_eq!(with(&[]), None);
    }

    #[test]
    fn the_main_revision_is_taken() {
        let cache = tempfile::tempdir().unwrap();
        let folder = cache.path().join("models--depth-anything--DA3-SMALL");
        let find = || in_cache(cache.path(), "depth-anything/DA3-SMALL");
        assert_eq!(find(), Err(folder.clone()));
        std::fs::create_dir_all(folder.join("snapshots/abc123")).unwrap();
        std::fs::create_dir_all(folder.join("refs")).unwrap();
        assert_eq!(find(), Err(folder.clone()));
        std::fs::write(folder.join("refs/main"), "abc123\n").unwrap();
        assert_eq!(find(), Ok(folder.join("snapshots/abc123")));
        for nowhere in ["", "def", "../../..", "/etc"] {
            std::fs::write(folder.join("refs/main"), nowhere).unwrap();
            assert_eq!(find(), Err(folder.clone()), "{nowhere}");
        }
    }
}
