//! The rules of the tree as tests: the same checks as `cargo xtask tidy`, on this very repository.

use xtask::{Finding, Level, Tree, arrows, places, text};

fn errors(findings: Vec<Finding>) -> String {
    let errors = findings.iter().filter(|finding| finding.level == Level::Error);
    errors.map(|finding| format!("\n  {finding}")).collect()
}

fn tree() -> Tree {
    Tree::read(xtask::root()).expect("the repository is readable")
}

#[test]
fn crates_know_only_what_they_may() {
    let metadata = arrows::metadata(xtask::root()).expect("cargo metadata runs");
    assert_eq!(errors(arrows::check(&metadata).expect("it has the documented form")), "");
}

#[test]
fn every_kernel_is_in_its_five_places() {
    assert_eq!(errors(places::check(&tree())), "");
}

#[test]
fn files_are_short_headed_and_finished() {
    assert_eq!(errors(text::check(&tree())), "");
}
