//! Command-line inputs to sources: what exists under the name decides, patterns come last.

use std::{
    fs, io,
    path::{Path, PathBuf},
};

use super::{Source, SourceKind, extension, is_image, is_video, video};
use crate::IoError;

/// Appends the videos of one input.
pub(super) fn resolve(input: &Path, sources: &mut Vec<Source>, notes: &mut Vec<String>) -> Result<(), IoError> {
    let path = input.to_owned();
    let mut push = |path: PathBuf, kind: SourceKind| {
        let video = sources.len() as u32;
        sources.push(Source { input: input.to_owned(), path, video, kind });
    };
    match fs::metadata(&path) {
        Ok(meta) if meta.is_dir() => {
            for (folder, files) in folder_videos(&path, notes)? {
                push(folder, SourceKind::Images(files));
            }
        }
        Ok(_) if is_image(&path) => push(path.clone(), SourceKind::Images(vec![path])),
        Ok(_) if is_video(&path) => {
            let info = video::probe_video(&path)?;
            push(path, SourceKind::Video(info));
        }
        Ok(_) => return Err(IoError::UnsupportedExtension { extension: extension(&path), path }),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            let files = pattern_files(input, notes)?;
            push(path, SourceKind::Images(files));
        }
        Err(source) => return Err(IoError::read(path, source)),
    }
    Ok(())
}

/// Pictures of a folder: one video, or one for each sub-folder.
fn folder_videos(folder: &Path, notes: &mut Vec<String>) -> Result<Vec<(PathBuf, Vec<PathBuf>)>, IoError> {
    let top = list(folder)?;
    if !top.folders.is_empty() {
        let mut videos = Vec::with_capacity(top.folders.len());
        for sub in &top.folders {
            videos.push((sub.clone(), list(sub)?.images));
        }
        if videos.iter().any(|(_, files)| !files.is_empty()) {
            if !top.images.is_empty() {
                notes.push(format!(
                    "{}: its sub-folders are the videos; {} picture(s) beside them are left aside",
                    folder.display(),
                    top.images.len()
                ));
            }
            return Ok(videos);
        }
        if !top.images.is_empty() {
            notes.push(format!("{}: its sub-folders hold no pictures and are left aside", folder.display()));
        }
    }
    if top.images.is_empty() {
        return Err(IoError::NoFrames { found: top.describe(), path: folder.to_owned() });
    }
    Ok(vec![(folder.to_owned(), top.images)])
}

/// Matching pictures of a pattern, sorted by path as text.
fn pattern_files(input: &Path, notes: &mut Vec<String>) -> Result<Vec<PathBuf>, IoError> {
    let Some(pattern) = input.to_str().filter(|p| p.contains(['*', '?', '['])) else {
        return Err(IoError::NotFound { path: input.to_owned() });
    };
    let matches =
        glob::glob(pattern).map_err(|e| IoError::BadPattern { pattern: pattern.to_owned(), reason: e.to_string() })?;
    let mut images = Vec::new();
    let mut others = 0usize;
    for entry in matches {
        let path = entry.map_err(|e| {
            let path = e.path().to_owned();
            IoError::read(path, e.into())
        })?;
        if is_image(&path) && path.is_file() {
            images.push(path);
        } else {
            others += 1;
        }
    }
    if images.is_empty() && others == 0 {
        return Err(IoError::NotFound { path: pattern.into() });
    }
    if images.is_empty() {
        let found = format!("{others} matching file(s) or folder(s), none a picture");
        return Err(IoError::NoFrames { found, path: pattern.into() });
    }
    if others > 0 {
        notes.push(format!("{pattern}: {others} match(es) are no pictures and are left aside"));
    }
    images.sort();
    Ok(images)
}

/// What a folder holds, sorted by name as text.
struct Listing {
    folders: Vec<PathBuf>,
    images: Vec<PathBuf>,
    videos: usize,
    others: usize,
}

impl Listing {
    fn describe(&self) -> String {
        if self.videos > 0 {
            return format!("{} video file(s): pass each of them as an input of its own", self.videos);
        }
        match (self.folders.len(), self.others) {
            (0, 0) => "an empty folder".to_owned(),
            (0, n) => format!("{n} file(s), none of them png, jpg, jpeg, webp or bmp"),
            (n, _) => format!("{n} sub-folder(s) without pictures"),
        }
    }
}

fn list(folder: &Path) -> Result<Listing, IoError> {
    let read = |source| IoError::read(folder, source);
    let mut listing = Listing { folders: Vec::new(), images: Vec::new(), videos: 0, others: 0 };
    for entry in fs::read_dir(folder).map_err(read)? {
        let entry = entry.map_err(read)?;
        let path = entry.path();
        let kind = entry.file_type().map_err(read)?;
        // Only links need the extra look at what they point to; a dangling one counts as a file that is no picture.
        let is_dir = kind.is_dir() || (kind.is_symlink() && path.is_dir());
        let is_file = kind.is_file() || (kind.is_symlink() && path.is_file());
        if is_dir {
            listing.folders.push(path);
        } else if is_file && is_image(&path) {
            listing.images.push(path);
        } else if is_video(&path) {
            listing.videos += 1;
        } else {
            listing.others += 1;
        }
    }
    // Within one folder, sorting paths is sorting names.
    listing.folders.sort();
    listing.images.sort();
    Ok(listing)
}
