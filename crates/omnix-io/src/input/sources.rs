//! Command-line inputs to sources: what exists under the name decides, patterns come last.

use std::{
    cmp::Ordering,
    fs, io,
    path::{Path, PathBuf},
};

use super::{
    kinds::{extension, is_hidden, is_image, is_video},
    options::ReadOptions,
    plan::{Source, SourceKind},
    video,
};
use crate::IoError;

/// Appends the videos of one input.
pub(super) fn resolve(
    input: &Path,
    options: &ReadOptions,
    sources: &mut Vec<Source>,
    notes: &mut Vec<String>,
) -> Result<(), IoError> {
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
        // Pipes and devices never end, or keep whoever opens them waiting.
        Ok(meta) if !meta.is_file() => return Err(IoError::NotAPlainFile { path }),
        Ok(_) if is_image(&path) => push(path.clone(), SourceKind::Images(vec![path])),
        Ok(_) if is_video(&path) => {
            let info = video::probe_video(&path, options)?;
            let told = info.damage.iter().map(ToString::to_string).chain(info.notes.iter().cloned());
            notes.extend(told.map(|note| format!("{}: {note}", path.display())));
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
        let mut left = Vec::new();
        for sub in &top.folders {
            let inside = list(sub)?;
            left.extend(inside.note(sub, true));
            videos.push((sub.clone(), inside.images));
        }
        if videos.iter().any(|(_, files)| !files.is_empty()) {
            if !top.images.is_empty() {
                notes.push(format!(
                    "{}: its sub-folders are the videos; {} picture(s) beside them are left aside",
                    folder.display(),
                    top.images.len()
                ));
            }
            notes.extend(top.note(folder, false));
            notes.extend(left);
            return Ok(videos);
        }
        if !top.images.is_empty() {
            notes.push(format!("{}: its sub-folders hold no pictures and are left aside", folder.display()));
        }
    }
    if top.images.is_empty() {
        return Err(IoError::NoFrames { found: top.describe(), path: folder.to_owned() });
    }
    notes.extend(top.note(folder, false));
    Ok(vec![(folder.to_owned(), top.images)])
}

/// Matching pictures of a pattern, sorted by path.
fn pattern_files(input: &Path, notes: &mut Vec<String>) -> Result<Vec<PathBuf>, IoError> {
    let Some(pattern) = input.to_str().filter(|p| p.contains(['*', '?', '['])) else {
        return Err(IoError::NotFound { path: input.to_owned() });
    };
    let matches =
        glob::glob(pattern).map_err(|e| IoError::BadPattern { pattern: pattern.to_owned(), reason: e.to_string() })?;
    let mut listing = Listing::default();
    for entry in matches {
        let path = entry.map_err(|e| {
            let path = e.path().to_owned();
            IoError::read(path, e.into())
        })?;
        listing.add(path);
    }
    listing.sort();
    if listing.images.is_empty() {
        return Err(if listing.is_empty() {
            IoError::NotFound { path: pattern.into() }
        } else {
            IoError::NoFrames { found: listing.describe_matches(), path: pattern.into() }
        });
    }
    notes.extend(listing.note(input, true));
    Ok(listing.images)
}

/// Files and folders, by kind. Hidden ones are passed over.
#[derive(Default)]
struct Listing {
    folders: Vec<PathBuf>,
    images: Vec<PathBuf>,
    videos: Vec<PathBuf>,
    others: Vec<PathBuf>,
}

impl Listing {
    fn add(&mut self, path: PathBuf) {
        let list = match fs::metadata(&path) {
            _ if is_hidden(&path) => return,
            Ok(meta) if meta.is_dir() => &mut self.folders,
            Ok(meta) if meta.is_file() && is_image(&path) => &mut self.images,
            Ok(meta) if meta.is_file() && is_video(&path) => &mut self.videos,
            // Files of other kinds, pipes, and links to nothing.
            _ => &mut self.others,
        };
        list.push(path);
    }

    fn sort(&mut self) {
        for list in [&mut self.folders, &mut self.images, &mut self.videos, &mut self.others] {
            list.sort_by(|a, b| by_value(a, b));
        }
    }

    fn is_empty(&self) -> bool {
        self.folders.is_empty() && self.images.is_empty() && self.videos.is_empty() && self.others.is_empty()
    }

    /// What a folder without pictures holds.
    fn describe(&self) -> String {
        if !self.videos.is_empty() {
            return format!("{}: pass each of them as an input of its own", named("video file", &self.videos));
        }
        match (self.folders.len(), self.others.len()) {
            (0, 0) => "an empty folder".to_owned(),
            (0, _) => format!("{}, not a png, jpg, jpeg, webp or bmp among them", named("file", &self.others)),
            (n, _) => format!("{n} sub-folder(s) without pictures"),
        }
    }

    /// What a pattern matches, if no picture.
    fn describe_matches(&self) -> String {
        if !self.videos.is_empty() {
            return format!(
                "{}: a pattern is for pictures, so pass each video as an input of its own (without quotation marks the shell \
                 writes them out)",
                named("video file", &self.videos)
            );
        }
        let matches: Vec<PathBuf> = self.others.iter().chain(&self.folders).cloned().collect();
        format!("{}, not a picture among them", named("file or folder", &matches))
    }

    /// What is not read of it; folders too where they are not videos themselves.
    fn note(&self, place: &Path, folders: bool) -> Option<String> {
        let mut left: Vec<PathBuf> = self.videos.iter().chain(&self.others).cloned().collect();
        if folders {
            left.extend(self.folders.iter().cloned());
        }
        let cure = if self.videos.is_empty() { "" } else { "; a video is an input of its own" };
        let what = if folders { "file or folder" } else { "file" };
        (!left.is_empty()).then(|| format!("{}: {} not read{cure}", place.display(), named(what, &left)))
    }
}

/// How many, of what, and the first names.
fn named(what: &str, paths: &[PathBuf]) -> String {
    const SHOWN: usize = 5;
    let name = |p: &PathBuf| p.file_name().unwrap_or(p.as_os_str()).to_string_lossy().into_owned();
    let mut names: Vec<String> = paths.iter().take(SHOWN).map(name).collect();
    if paths.len() > SHOWN {
        names.push("...".to_owned());
    }
    format!("{} {what}(s) ({})", paths.len(), names.join(", "))
}

fn list(folder: &Path) -> Result<Listing, IoError> {
    let read = |source| IoError::read(folder, source);
    let mut listing = Listing::default();
    for entry in fs::read_dir(folder).map_err(read)? {
        listing.add(entry.map_err(read)?.path());
    }
    listing.sort();
    Ok(listing)
}

/// By name as people count, so that frame2 comes before frame10 and frame010; what is equal in that way, as text. (The crate natord
/// takes numbers with a zero in front for fractions: 010 before 9.)
fn by_value(a: &Path, b: &Path) -> Ordering {
    let (mut x, mut y) = (a.as_os_str().as_encoded_bytes(), b.as_os_str().as_encoded_bytes());
    while let (Some(&c), Some(&d)) = (x.first(), y.first()) {
        let order = if c.is_ascii_digit() && d.is_ascii_digit() {
            let (m, n) = (number(&mut x), number(&mut y));
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
        } else {
            (x, y) = (&x[1..], &y[1..]);
            c.cmp(&d)
        };
        if order.is_ne() {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(b))
}

/// Takes the digits off the front; without zeros in front of them a longer number is a larger one.
fn number<'a>(bytes: &mut &'a [u8]) -> &'a [u8] {
    let end = bytes.iter().position(|b| !b.is_ascii_digit()).unwrap_or(bytes.len());
    let (digits, rest) = bytes.split_at(end);
    *bytes = rest;
    let zeros = digits.iter().position(|b| *b != b'0').unwrap_or(digits.len());
    &digits[zeros..]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_in_names_count() {
        let order = [
            "Frame3.png",
            "a/9.png",
            "a/10.png",
            "b/frame.png",
            "b/frame0.png",
            "b/frame1.png",
            "b/frame002.png",
            "b/frame2.png",
            "b/frame9.png",
            "b/frame010.png",
            "b/frame99999999999999999999998.png",
            "b/frame99999999999999999999999.png",
            "b/frames1.png",
        ];
        for (i, a) in order.iter().enumerate() {
            for (j, b) in order.iter().enumerate() {
                assert_eq!(by_value(Path::new(a), Path::new(b)), i.cmp(&j), "{a} and {b}");
            }
        }
    }
}
