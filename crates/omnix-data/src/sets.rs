//! Data sets on disk (`spec/omnix.md` 11.5): which one a folder holds, and its scenes. One file per data set states its layout.
//!
//! Poses in the files are camera to world in OpenCV axes, except where a set's file says otherwise; depth is z-depth. Whether a folder
//! keeps to that is measured by the check of data sets.

mod dl3dv;
mod droid;
mod dynamic_replica;
mod hoi4d;
mod mesh;
mod omnigame;
mod output;
mod pointodyssey;
pub mod shared;
mod spring;
mod stereo4d;
#[cfg(test)]
mod tests_support;
mod ue;
mod waymo;

use std::path::{Path, PathBuf};

use crate::DataError;
use crate::files::folders;
use crate::scene::Scene;
use crate::set::Set;

/// What to know of a set without opening a scene of it.
struct Facts {
    set: Set,
    /// What a scene's folder holds, and no other set's does. Where several fit, the first in the list wins.
    signature: &'static [&'static str],
    open: fn(&Path) -> Result<Box<dyn Scene>, DataError>,
}

/// In the order in which folders are compared with them: those with more to show come first.
const FACTS: [Facts; 12] = [
    Facts { set: Set::Shared, signature: shared::SIGNATURE, open: shared::open },
    Facts { set: Set::Output, signature: output::SIGNATURE, open: output::open },
    Facts { set: Set::Droid, signature: droid::SIGNATURE, open: droid::open },
    Facts { set: Set::Stereo4d, signature: stereo4d::SIGNATURE, open: stereo4d::open },
    Facts { set: Set::DynamicReplica, signature: dynamic_replica::SIGNATURE, open: dynamic_replica::open },
    Facts { set: Set::Dl3dv, signature: dl3dv::SIGNATURE, open: dl3dv::open },
    Facts { set: Set::Ue, signature: ue::SIGNATURE, open: ue::open },
    Facts { set: Set::Waymo, signature: waymo::SIGNATURE, open: waymo::open },
    Facts { set: Set::OmniGame, signature: omnigame::SIGNATURE, open: omnigame::open },
    Facts { set: Set::Hoi4d, signature: hoi4d::SIGNATURE, open: hoi4d::open },
    Facts { set: Set::PointOdyssey, signature: pointodyssey::SIGNATURE, open: pointodyssey::open },
    Facts { set: Set::Spring, signature: spring::SIGNATURE, open: spring::open },
];

fn facts(set: Set) -> &'static Facts {
    // The list has every set; a test holds it to that.
    FACTS.iter().find(|facts| facts.set == set).unwrap_or(&FACTS[0])
}

/// The set whose scene this folder looks like.
#[must_use]
pub fn of_folder(folder: &Path) -> Option<Set> {
    let fits = |facts: &&Facts| facts.signature.iter().all(|part| folder.join(part).exists());
    FACTS.iter().find(fits).map(|facts| facts.set)
}

/// Opens the scene in a folder; without a set, that of which it has the parts.
///
/// # Errors
/// A folder that looks like no known set, or lacks parts of its layout.
pub fn open(folder: &Path, set: Option<Set>) -> Result<Box<dyn Scene>, DataError> {
    if !folder.is_dir() {
        return Err(DataError::Missing { path: folder.to_owned() });
    }
    match set.or_else(|| of_folder(folder)) {
        Some(set) => (facts(set).open)(folder),
        None => Err(unknown(folder)?),
    }
}

/// Folders below this one are looked into, so deep.
const DEPTH: usize = 4;

/// The folders of scenes at or below a folder, in the order of their names.
///
/// # Errors
/// A folder that cannot be read, or has no scene of the set in it.
pub fn find(folder: &Path, set: Option<Set>) -> Result<Vec<PathBuf>, DataError> {
    if !folder.is_dir() {
        return Err(DataError::Missing { path: folder.to_owned() });
    }
    let mut scenes = Vec::new();
    search(folder, set, DEPTH, &mut scenes)?;
    if !scenes.is_empty() {
        return Ok(scenes);
    }
    let Some(wanted) = set else { return Err(unknown(folder)?) };
    search(folder, None, DEPTH, &mut scenes)?;
    let mut others: Vec<&str> = scenes.iter().filter_map(|scene| Some(of_folder(scene)?.name())).collect();
    others.sort_unstable();
    others.dedup();
    if others.is_empty() {
        return Err(unknown(folder)?);
    }
    Err(DataError::OtherSet { wanted: wanted.name(), found: others.join(", "), path: folder.to_owned() })
}

fn search(folder: &Path, set: Option<Set>, depth: usize, scenes: &mut Vec<PathBuf>) -> Result<(), DataError> {
    let found = of_folder(folder);
    if found.is_some() && set.is_none_or(|set| found == Some(set)) {
        scenes.push(folder.to_owned());
        return Ok(());
    }
    if depth > 0 {
        for inner in folders(folder)? {
            search(&inner, set, depth - 1, scenes)?;
        }
    }
    Ok(())
}

fn unknown(folder: &Path) -> Result<DataError, DataError> {
    let names: Vec<String> = std::fs::read_dir(folder)
        .map_err(|source| DataError::read(folder, source))?
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .collect();
    let mut names: Vec<&str> = names.iter().map(String::as_str).collect();
    names.sort_unstable();
    let most = 12;
    let more = if names.len() > most { ", ..." } else { "" };
    names.truncate(most);
    let found = if names.is_empty() { "nothing".to_owned() } else { format!("{}{more}", names.join(", ")) };
    let known =
        FACTS.iter().map(|facts| format!("{} ({})", facts.set.name(), facts.signature.join(", "))).collect::<Vec<_>>();
    Ok(DataError::UnknownSet { found, known: known.join("; "), path: folder.to_owned() })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_set_has_its_facts() {
        for set in Set::ALL {
            assert_eq!(facts(set).set, set);
        }
        assert_eq!(Set::ALL.len(), FACTS.len());
    }

    #[test]
    fn what_is_no_scene_is_told_with_what_is_there() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir_all(dir.path().join("a/image")).unwrap();
        let error = open(&dir.path().join("a"), None).unwrap_err().to_string();
        assert!(error.contains("found: image") && error.contains("ue (image"), "{error}");
        assert!(matches!(find(dir.path(), None), Err(DataError::UnknownSet { .. })));
        assert!(matches!(find(&dir.path().join("b"), None), Err(DataError::Missing { .. })));
    }

    #[test]
    fn scenes_are_found_below() {
        let dir = tempfile::tempdir().unwrap();
        for part in ["2/dense/rgb", "1/image", "1/vertex", "1/face"] {
            std::fs::create_dir_all(dir.path().join(part)).unwrap();
        }
        std::fs::write(dir.path().join("1/face.npz"), "").unwrap();
        let scenes = find(dir.path(), None).unwrap();
        assert_eq!(scenes, [dir.path().join("1"), dir.path().join("2")]);
        assert_eq!(find(dir.path(), Some(Set::Dl3dv)).unwrap().len(), 1);
        let other = find(dir.path(), Some(Set::Spring)).unwrap_err().to_string();
        assert!(other.contains("no scene of spring, but of dl3dv, ue"), "{other}");
    }
}
