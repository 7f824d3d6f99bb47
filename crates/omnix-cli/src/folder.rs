//! Inputs and results are kept apart: no run takes another's results for pictures, or replaces what it reads.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read as _;
use std::path::{Path, PathBuf, absolute};

use omnix::io::output::manifest::MANIFEST;
use omnix::io::{Export, InputPlan};

use crate::error::CliError;

/// Refuses results of a run as pictures: those in `out`, which would be replaced while they are read, and those that an input
/// folder holds beside its pictures. Returns a note where this run's results go into an input folder.
pub(crate) fn check(out: &Path, input: &InputPlan) -> Result<Option<String>, CliError> {
    let out = real(out);
    let refuse = |reason: String, path: &Path| Err(CliError::ResultsAsInputs { reason, path: path.to_owned() });
    let mut manifests = BTreeMap::new();
    let mut before = None;
    for frame in &input.frames {
        // The frames of a video are one file.
        if before.replace(&frame.path) == Some(&frame.path) {
            continue;
        }
        let path = real(&frame.path);
        if is_result(&path, &out) {
            return refuse("an input has the name of a result of this run".into(), &frame.path);
        }
        let source = input.sources.iter().find(|source| source.video == frame.video).map(|source| real(&source.input));
        // Results lie at most three folders below their manifest. A folder of results that is named itself is meant.
        let above =
            path.ancestors().skip(1).take(4).take_while(|dir| source.as_ref().is_some_and(|s| dir.starts_with(s)));
        for dir in above {
            if *manifests.entry(dir.to_owned()).or_insert_with(|| has_manifest(dir)) && is_result(&path, dir) {
                return refuse(
                    "an input folder holds results of an earlier run beside its pictures".into(),
                    &frame.path,
                );
            }
        }
    }
    let inside = input.sources.iter().any(|source| source.input.is_dir() && real(&source.input) == out);
    Ok(inside.then(|| {
        "the results go into the folder of the inputs, which cannot be read as pictures again until they are moved away; --out names \
         another"
            .to_owned()
    }))
}

/// Whether `path` has the name of a result in the output folder `dir`.
fn is_result(path: &Path, dir: &Path) -> bool {
    let inside = path.strip_prefix(dir).map(|inside| inside.to_string_lossy().replace(std::path::MAIN_SEPARATOR, "/"));
    inside.is_ok_and(|name| Export::leaves(&name))
}

/// Whether a run left its manifest here.
fn has_manifest(dir: &Path) -> bool {
    let mut start = [0; 64];
    let read = File::open(dir.join(MANIFEST)).and_then(|mut file| file.read(&mut start));
    read.is_ok_and(|count| String::from_utf8_lossy(&start[..count]).contains("\"omnix-manifest-"))
}

/// The path without links and dots, as far as it exists.
fn real(path: &Path) -> PathBuf {
    let path = absolute(path).unwrap_or_else(|_| path.to_owned());
    let mut rest = Vec::new();
    for folder in path.ancestors() {
        if let Ok(found) = folder.canonicalize() {
            return rest.iter().rev().fold(found, |path, name| path.join(name));
        }
        rest.extend(folder.file_name());
    }
    path
}

#[cfg(test)]
mod tests {
    use super::*;
    use omnix::io::{FrameChoice, probe};

    fn picture(path: &Path) -> String {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::save_buffer(path, &[0; 3 * 28 * 28], 28, 28, image::ColorType::Rgb8).unwrap();
        path.to_str().unwrap().to_owned()
    }

    #[test]
    fn inputs_and_results_stay_apart() {
        let dir = tempfile::tempdir().unwrap();
        let photos = dir.path().join("photos");
        let photo = picture(&photos.join("a.png"));
        let result = picture(&photos.join("depth/000000.png"));
        let check = |out: &Path, input: &str| check(out, &probe(&[input], FrameChoice::all()).unwrap());
        let (folder, elsewhere) = (photos.to_str().unwrap(), dir.path().join("elsewhere"));
        // A picture beside its results is common and harms nothing; one that would be replaced is lost.
        assert!(check(&photos, &photo).unwrap().is_none());
        assert!(check(&photos, &result).is_err() && check(&elsewhere, &result).unwrap().is_none());
        // Sub-folders are videos; whether they are results, a manifest tells.
        assert!(check(&elsewhere, folder).unwrap().is_none());
        std::fs::write(photos.join(MANIFEST), "{\n  \"format\": \"omnix-manifest-1\",").unwrap();
        assert!(check(&elsewhere, folder).is_err());
        assert!(check(&elsewhere, photos.join("depth").to_str().unwrap()).unwrap().is_none(), "named itself");
        std::fs::remove_dir_all(photos.join("depth")).unwrap();
        // The very folder, by other names.
        assert!(check(&photos.join("../photos/."), folder).unwrap().is_some());
        assert!(check(&photos.join("out"), folder).unwrap().is_none());
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink(&photos, dir.path().join("link")).unwrap();
            assert!(check(&dir.path().join("link"), folder).unwrap().is_some(), "a link to it");
        }
    }
}
