//! The rules of the tree as tests: the same checks as `cargo xtask tidy`, on this very repository.

use serde_json::Value;
use xtask::{Finding, Level, Tree, arrows, circles, dependencies, metadata, places, sizes, text};

fn errors(findings: Vec<Finding>) -> String {
    let errors = findings.iter().filter(|finding| finding.level == Level::Error);
    errors.map(|finding| format!("\n  {finding}")).collect()
}

fn tree() -> Tree {
    Tree::read(xtask::root()).expect("the repository is readable")
}

fn workspace() -> Value {
    metadata::read(xtask::root()).expect("cargo metadata runs")
}

#[test]
fn crates_know_only_what_they_may() {
    assert_eq!(errors(arrows::check(&workspace()).expect("it has the documented form")), "");
}

#[test]
fn every_kernel_is_in_its_six_places() {
    assert_eq!(errors(places::check(&tree())), "");
}

#[test]
fn files_are_short_headed_and_finished() {
    assert_eq!(errors(text::check(&tree())), "");
}

#[test]
fn files_are_small_enough_to_clone() {
    assert_eq!(errors(sizes::check(&tree())), "");
}

#[test]
fn every_dependency_is_used() {
    let findings = dependencies::check(&workspace(), &tree(), xtask::root());
    assert_eq!(errors(findings.expect("it has the documented form")), "");
}

#[test]
fn no_files_import_each_other_in_a_circle() {
    let roots = metadata::roots(&workspace(), xtask::root()).expect("it has the documented form");
    assert_eq!(errors(circles::check(&tree(), &roots)), "");
}
