//! Masks: pictures that say something of each pixel of other pictures, found by name and read to "yes" or "no" for a pixel.
//!
//! A folder holds one mask a picture, itself or in folders below, as png, jpg, webp or bmp. The mask of `street/007.jpg` is `007.jpg.png`, as COLMAP
//! names them, or `007.png`; of several, the one with most folders in common. The mask of a video's frame is named as the frame is
//! everywhere: `NAME_NNNNNN.png` with the frame's number in the video `NAME`, from 0. A pixel of a mask is "yes" unless it is black (0 in every
//! channel); its own transparency says nothing. A mask of another size than its picture's is read by the nearest pixel; one of another shape is
//! refused.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};

use crate::IoError;
use crate::cameras::{common_folders, stem};
use crate::input::{InputPlan, image_size, is_hidden, is_image, not_black, opaque};

/// Share by which the shapes of two sizes of one picture may differ, where sides were rounded.
const SHAPE: f64 = 0.01;
/// Folders below the one that was named.
const DEEPEST: usize = 16;

/// A mask's pixels, row by row.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Mask {
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Whether each pixel says yes.
    pub data: Vec<bool>,
}

impl Mask {
    /// What is said at a place of a picture whose width and height are 1.
    #[must_use]
    pub fn at(&self, [x, y]: [f64; 2]) -> bool {
        let index = |place: f64, side: u32| ((place * f64::from(side)) as usize).min(side as usize - 1);
        self.data[index(y, self.height) * self.width as usize + index(x, self.width)]
    }

    /// Reads a mask.
    ///
    /// # Errors
    /// As [`crate::input::load_picture`].
    pub fn read(path: &Path) -> Result<Self, IoError> {
        not_black(path).map(|(width, height, data)| Self { width, height, data })
    }

    /// Which pixels of a picture are at least half opaque; none where it has no alpha channel.
    ///
    /// # Errors
    /// As [`crate::input::load_picture`].
    pub fn of_alpha(path: &Path) -> Result<Option<Self>, IoError> {
        Ok(opaque(path)?.map(|(width, height, data)| Self { width, height, data }))
    }
}

/// The masks of a folder, each with its frame.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct MatchedMasks {
    /// The mask of every frame, where there is one.
    pub files: Vec<Option<PathBuf>>,
    /// What a user should see: frames without a mask, masks without a frame, masks of other sizes.
    pub notes: Vec<String>,
}

/// Finds the mask of every frame, and looks at their sizes.
///
/// # Errors
/// [`IoError::BadMasks`]: no such folder, no mask for any of the frames, two that fit one frame alike, one that two frames would have, or one of
/// another shape than its frame.
pub fn match_masks(folder: &Path, plan: &InputPlan) -> Result<MatchedMasks, IoError> {
    let bad = |reason: String| IoError::BadMasks { reason, path: folder.to_owned() };
    if !folder.is_dir() {
        return Err(bad("masks are pictures in a folder, one for each input picture".to_owned()));
    }
    let mut all = Vec::new();
    list(folder, 0, &mut all)?;
    let mut by_stem: HashMap<&str, Vec<&Path>> = HashMap::new();
    all.iter().for_each(|path| by_stem.entry(stem(path)).or_default().push(path));
    let (mut files, mut taken) = (Vec::with_capacity(plan.frames.len()), HashMap::new());
    let mut resized: Option<(usize, String)> = None;
    for (frame, name) in plan.frames.iter().zip(plan.picture_names()) {
        let name = Path::new(&name).file_name().unwrap_or_default().to_string_lossy().into_owned();
        let short = stem(Path::new(&name));
        // The mask in the folders most like the picture's; there, the one that names the whole picture.
        let named = |stem: &str, whole: bool| {
            let found = by_stem.get(stem).into_iter().flatten();
            found.map(move |path| ((common_folders(path, &frame.path), whole), *path))
        };
        let mut fitting: Vec<_> = named(&name, true).chain(named(short, false)).collect();
        fitting.sort_by_key(|found| std::cmp::Reverse(found.0));
        let found = match *fitting {
            [(first, a), (second, b), ..] if first == second => {
                let (a, b) = (a.display(), b.display());
                return Err(bad(format!("{a} and {b} fit {} alike: leave one of them out", frame.path.display())));
            }
            [(_, path), ..] => path,
            [] => {
                files.push(None);
                continue;
            }
        };
        if let Some(before) = taken.insert(found, &frame.path) {
            return Err(bad(format!(
                "{} and {} would both have the mask {}: put masks into folders named as those of the pictures",
                before.display(),
                frame.path.display(),
                found.display()
            )));
        }
        let (of, own) = (image_size(found)?, (frame.width, frame.height));
        let [a, b] = [of, own].map(|(w, h)| f64::from(w) / f64::from(h));
        if (a / b - 1.0).abs() > SHAPE {
            return Err(bad(format!(
                "{} has {}x{} pixels and {} has {}x{}: a mask has the shape of its picture",
                found.display(),
                of.0,
                of.1,
                frame.path.display(),
                own.0,
                own.1
            )));
        }
        if of != own {
            let first = || format!("{} has {}x{} for {}x{}", found.display(), of.0, of.1, own.0, own.1);
            resized = Some(resized.map_or_else(|| (1, first()), |(count, first)| (count + 1, first)));
        }
        files.push(Some(found.to_owned()));
    }
    let without: Vec<String> =
        plan.picture_names().into_iter().zip(&files).filter(|(_, file)| file.is_none()).map(|(name, _)| name).collect();
    let used: BTreeSet<&Path> = files.iter().flatten().map(PathBuf::as_path).collect();
    let unused: Vec<&PathBuf> = all.iter().filter(|path| !used.contains(path.as_path())).collect();
    let (frames, masks) = (files.len(), all.len());
    if used.is_empty() {
        let first = unused.first().map_or_else(|| "there are none".to_owned(), |path| path.display().to_string());
        let want = without.first().map(String::as_str).unwrap_or_default();
        return Err(bad(format!(
            "none of its {masks} picture(s) (the first: {first}) is the mask of an input: that of {want} would be {want}.png or {}.png",
            stem(Path::new(want))
        )));
    }
    let at = folder.display();
    let mut notes = Vec::new();
    if let Some(first) = without.first() {
        let count = without.len();
        notes.push(format!(
            "{count} of {frames} image(s) have no mask in {at} (the first: {first}): it says nothing of them"
        ));
    }
    if let Some(first) = unused.first() {
        let count = unused.len();
        notes.push(format!("{count} mask(s) are of no input (the first: {})", first.display()));
    }
    if let Some((count, first)) = resized {
        notes.push(format!("{count} mask(s) are of another size than their pictures and were read by the nearest pixel (the first: {first})"));
    }
    Ok(MatchedMasks { files, notes })
}

/// All pictures of a folder and of those below it, in order.
fn list(folder: &Path, depth: usize, found: &mut Vec<PathBuf>) -> Result<(), IoError> {
    if depth > DEEPEST {
        return Ok(());
    }
    let entries = std::fs::read_dir(folder).map_err(|e| IoError::read(folder, e))?;
    let mut paths = Vec::new();
    for entry in entries {
        paths.push(entry.map_err(|e| IoError::read(folder, e))?.path());
    }
    paths.sort_unstable();
    for path in paths.into_iter().filter(|path| !is_hidden(path)) {
        if path.is_dir() {
            list(&path, depth + 1, found)?;
        } else if is_image(&path) {
            found.push(path);
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{ReadOptions, probe_with};

    fn grey(path: &Path, [width, height]: [u32; 2], value: impl Fn(u32, u32) -> u8) {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        image::GrayImage::from_fn(width, height, |x, y| image::Luma([value(x, y)])).save(path).unwrap();
    }

    fn plan(dir: &Path, names: &[&str]) -> InputPlan {
        names.iter().for_each(|name| grey(&dir.join("in").join(name), [40, 20], |x, _| x as u8));
        let inputs: Vec<PathBuf> = names.iter().map(|name| dir.join("in").join(name)).collect();
        probe_with(&inputs, &ReadOptions::default()).unwrap()
    }

    #[test]
    fn masks_are_found_by_either_name() {
        let dir = tempfile::tempdir().unwrap();
        let plan = plan(dir.path(), &["a/1.png", "b/1.png", "b/2.jpg", "b/3.png"]);
        let masks = dir.path().join("masks");
        for name in ["a/1.png", "b/1.png.png", "2.jpg.png", "9.png", ".hidden.png"] {
            grey(&masks.join(name), if name == "9.png" { [7, 7] } else { [20, 10] }, |x, _| u8::from(x > 9));
        }
        let found = match_masks(&masks, &plan).unwrap();
        let expected = [Some("a/1.png"), Some("b/1.png.png"), Some("2.jpg.png"), None];
        assert_eq!(found.files, expected.map(|name| name.map(|name| masks.join(name))));
        let notes = found.notes.join("\n");
        assert!(notes.contains("1 of 4 image(s)") && notes.contains("3.png"), "{notes}");
        assert!(notes.contains("1 mask(s) are of no input") && notes.contains("9.png"), "{notes}");
        assert!(notes.contains("3 mask(s) are of another size"), "{notes}");
        let mask = Mask::read(&masks.join("a/1.png")).unwrap();
        assert!(!mask.at([0.499, 0.0]) && mask.at([0.501, 0.99]) && mask.at([1.0, 1.0]));
    }

    #[test]
    fn masks_that_do_not_fit_are_refused_by_name() {
        let dir = tempfile::tempdir().unwrap();
        let plan = plan(dir.path(), &["a/1.png", "b/1.png"]);
        let refused = |name: &str, files: &[(&str, [u32; 2])], words: &[&str]| {
            let masks = dir.path().join(name);
            std::fs::create_dir_all(&masks).unwrap();
            files.iter().for_each(|(file, size)| grey(&masks.join(file), *size, |_, _| 1));
            let error = match_masks(&masks, &plan).unwrap_err().to_string();
            words.iter().for_each(|word| assert!(error.contains(word), "{word} not in {error}"));
        };
        refused("none", &[], &["none of its 0", "1.png.png"]);
        refused("other", &[("x.png", [40, 20])], &["x.png", "mask of an input"]);
        refused("shared", &[("1.png", [40, 20])], &["both have the mask", "a/1.png", "b/1.png"]);
        refused("shape", &[("a/1.png", [20, 20])], &["20x20", "40x20", "shape"]);
        refused("twice", &[("x/1.png", [40, 20]), ("y/1.png", [40, 20])], &["alike"]);
        let nowhere = match_masks(&dir.path().join("nowhere"), &plan).unwrap_err().to_string();
        assert!(nowhere.contains("folder") && nowhere.contains("nowhere"), "{nowhere}");
    }

    #[test]
    fn deep_masks_count_small_numbers_and_alpha_is_read_when_there_is_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("deep.png");
        image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0u16, 3]).unwrap().save(&path).unwrap();
        assert_eq!(Mask::read(&path).unwrap().data, [false, true]);
        assert_eq!(Mask::of_alpha(&path).unwrap(), None);
        let path = dir.path().join("alpha.png");
        image::RgbaImage::from_raw(3, 1, vec![9, 9, 9, 0, 9, 9, 9, 127, 0, 0, 0, 128]).unwrap().save(&path).unwrap();
        assert_eq!(Mask::of_alpha(&path).unwrap().unwrap().data, [false, false, true]);
    }
}
