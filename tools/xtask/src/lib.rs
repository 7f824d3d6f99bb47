//! Checks of the tree that neither rustc nor clippy makes: `cargo xtask tidy`, and the same as tests in `tests/workspace`.
//!
//! [`places`]: a kernel is in its six places. [`text`]: length, header and leftovers of a file. [`sizes`]: no large files.
//! [`arrows`]: which crate may know which. [`dependencies`]: what a Cargo.toml names is used. [`circles`]: no circle of
//! imports between the files of a crate. Each check is a pure function from what was read to [`Finding`]s.

pub mod arrows;
pub mod circles;
pub mod dependencies;
mod error;
mod finding;
pub mod metadata;
pub mod places;
pub mod sizes;
pub mod text;
pub mod tree;

use std::path::Path;

pub use error::XtaskError;
pub use finding::{Finding, Level};
pub use tree::Tree;

/// Root of the repository this was built from.
pub fn root() -> &'static Path {
    // tools/xtask is two levels below the root.
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    here.parent().and_then(Path::parent).unwrap_or(here)
}

/// All checks of the tree under `root`, sorted by level, then place.
///
/// # Errors
/// [`XtaskError`] when the tree or `cargo metadata` cannot be read.
pub fn tidy(root: &Path) -> Result<Vec<Finding>, XtaskError> {
    let tree = Tree::read(root)?;
    let metadata = metadata::read(root)?;
    let mut findings = places::check(&tree);
    findings.extend(text::check(&tree));
    findings.extend(sizes::check(&tree));
    findings.extend(arrows::check(&metadata)?);
    findings.extend(dependencies::check(&metadata, &tree, root)?);
    findings.extend(circles::check(&tree, &metadata::roots(&metadata, root)?));
    findings.sort_by(|a, b| (a.level, a).cmp(&(b.level, b)));
    Ok(findings)
}
