//! Files small enough to be cloned by everyone: a limit for each, and one for what tests bring along together.

use crate::{Finding, Tree};

const MIB: u64 = 1 << 20;

/// What any file may have.
const FILE: u64 = 6 * MIB;
/// Files that may have more.
const LARGER: [(&str, u64); 1] = [("assets/weights/nano/model.safetensors", 16 * MIB)];
/// What all files of a folder may have together.
const FOLDERS: [(&str, u64); 1] = [("tests/data/", 20 * MIB)];

/// The size of every file, and the sum of the folders that have a limit.
pub fn check(tree: &Tree) -> Vec<Finding> {
    let mut findings = Vec::new();
    for (path, bytes) in tree.sizes() {
        let limit = LARGER.iter().find(|(name, _)| *name == path).map_or(FILE, |(_, limit)| *limit);
        if bytes > limit {
            findings.push(Finding::error(path, format!("{bytes} bytes, {limit} allowed: {CURE}")));
        }
    }
    for (folder, limit) in FOLDERS {
        let bytes: u64 = tree.sizes().filter(|(path, _)| path.starts_with(folder)).map(|(_, bytes)| bytes).sum();
        if bytes > limit {
            findings.push(Finding::error(folder, format!("{bytes} bytes together, {limit} allowed: {CURE}")));
        }
    }
    findings
}

const CURE: &str =
    "everyone who clones the repository fetches it for ever; make it smaller, or make it where it is needed";

#[cfg(test)]
mod tests {
    use super::*;

    fn places(sizes: &[(&str, u64)]) -> Vec<String> {
        check(&Tree::from_sizes(sizes.iter().copied())).into_iter().map(|finding| finding.place).collect()
    }

    #[test]
    fn a_file_has_a_limit() {
        assert_eq!(places(&[("a/b.png", FILE), (LARGER[0].0, LARGER[0].1)]), [""; 0]);
        assert_eq!(places(&[("a/b.png", FILE + 1), (LARGER[0].0, LARGER[0].1 + 1)]), ["a/b.png", LARGER[0].0]);
    }

    #[test]
    fn a_folder_has_a_limit() {
        let fill =
            |last| [("tests/data/a", FILE), ("tests/data/b/c", FILE), ("tests/data/d", FILE), ("tests/data/e", last)];
        let left = FOLDERS[0].1 - 3 * FILE;
        assert_eq!(places(&fill(left)), [""; 0]);
        assert_eq!(places(&fill(left + 1)), ["tests/data/"]);
    }
}
