//! Which crate may know which, checked over `cargo metadata`.
//!
//! ```text
//! shaders <- kernels <- graph <- model <- omnix <- cli      tensors <- weights <- model      geometry <- model, io      tensors <- io
//! geometry, io, tensors <- data <- eval <- train, cli      data, geometry, tensors <- scenes <- train, cli
//! {graph, model, weights, data, eval} <- train <- cli
//! ```
//! `a <- b`: b knows a. A crate may also use what lies further down its own arrows. Nobody depends on the program; `data`, `eval`, `geometry`,
//! `io`, `scenes`, `tensors`, `weights` and `shaders` never reach wgpu, not even through others.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;

use crate::metadata::{array, string};
use crate::{Finding, XtaskError};

/// Package, and the packages of ours that it may depend on (as a normal, build or dev dependency).
const ARROWS: [(&str, &[&str]); 17] = [
    ("omnix-shaders", &[]),
    ("omnix-kernels", &["omnix-shaders"]),
    ("omnix-graph", &["omnix-kernels", "omnix-shaders"]),
    ("omnix-tensors", &[]),
    ("omnix-weights", &["omnix-tensors"]),
    ("omnix-geometry", &[]),
    ("omnix-io", &["omnix-geometry", "omnix-tensors"]),
    ("omnix-data", &["omnix-geometry", "omnix-io", "omnix-tensors"]),
    ("omnix-scenes", &["omnix-data", "omnix-geometry", "omnix-tensors"]),
    ("omnix-eval", &["omnix-data", "omnix-geometry", "omnix-io", "omnix-tensors"]),
    (
        "omnix-model",
        &["omnix-geometry", "omnix-graph", "omnix-kernels", "omnix-shaders", "omnix-tensors", "omnix-weights"],
    ),
    ("omnix", LIBRARIES),
    ("omnix-train", TRAIN),
    ("omnix-cli", ALL_BUT_CLI),
    ("omnix-tests", ALL_BUT_CLI),
    ("omnix-benches", BENCHES),
    ("xtask", &[]),
];

/// What the library is made of.
const LIBRARIES: &[&str] = &[
    "omnix-geometry",
    "omnix-graph",
    "omnix-io",
    "omnix-kernels",
    "omnix-model",
    "omnix-shaders",
    "omnix-tensors",
    "omnix-weights",
];

/// What training records into and reads from.
const TRAIN: &[&str] = &[
    "omnix-data",
    "omnix-eval",
    "omnix-scenes",
    "omnix-geometry",
    "omnix-graph",
    "omnix-io",
    "omnix-kernels",
    "omnix-model",
    "omnix-shaders",
    "omnix-tensors",
    "omnix-weights",
];

/// Nobody depends on the program: tests run it as a process.
const ALL_BUT_CLI: &[&str] = &[
    "omnix",
    "omnix-data",
    "omnix-eval",
    "omnix-geometry",
    "omnix-graph",
    "omnix-io",
    "omnix-kernels",
    "omnix-model",
    "omnix-scenes",
    "omnix-shaders",
    "omnix-tensors",
    "omnix-train",
    "omnix-weights",
    "xtask",
];

/// What benches measure, and the tests' package, which has the kernels' cases.
const BENCHES: &[&str] = &["omnix", "omnix-graph", "omnix-kernels", "omnix-tests", "omnix-weights"];

/// Packages that run without a GPU and compile in seconds: they never reach [`DEVICE`].
const NO_DEVICE: [&str; 8] = [
    "omnix-data",
    "omnix-eval",
    "omnix-geometry",
    "omnix-io",
    "omnix-scenes",
    "omnix-shaders",
    "omnix-tensors",
    "omnix-weights",
];
const DEVICE: [&str; 3] = ["wgpu", "wgpu-core", "wgpu-hal"];

/// All arrows between the workspace's packages are allowed ones, and those that run without a GPU never reach wgpu.
///
/// # Errors
/// [`XtaskError::Metadata`] when `metadata` lacks a field.
pub fn check(metadata: &Value) -> Result<Vec<Finding>, XtaskError> {
    let members: BTreeSet<&str> = array(metadata, "workspace_members")?.iter().filter_map(Value::as_str).collect();
    let mut names = BTreeMap::new();
    let mut ours = BTreeMap::new();
    for package in array(metadata, "packages")? {
        let (id, name) = (string(package, "id")?, string(package, "name")?);
        names.insert(id, name);
        if members.contains(id) {
            let mut known = BTreeSet::new();
            for dependency in array(package, "dependencies")? {
                known.insert(string(dependency, "name")?);
            }
            ours.insert(name, (id, known));
        }
    }

    let mut findings = Vec::new();
    for (name, (_, known)) in &ours {
        let Some((_, allowed)) = ARROWS.iter().find(|(package, _)| package == name) else {
            findings.push(Finding::error(
                *name,
                "a package without arrows: say in tools/xtask/src/arrows.rs what it may know",
            ));
            continue;
        };
        let wrong = known.iter().filter(|other| ours.contains_key(*other) && !allowed.contains(other));
        findings.extend(wrong.map(|other| {
            Finding::error(
                *name,
                format!("must not depend on {other}: it may know {allowed:?} (ARCHITECTURE.md, \"Crates\")"),
            )
        }));
    }

    let edges = edges(metadata)?;
    for name in NO_DEVICE {
        let Some((id, _)) = ours.get(name) else {
            continue;
        };
        if let Some(path) = path_to_device(id, &edges, &names) {
            findings.push(Finding::error(name, format!("must not reach wgpu: {}", path.join(" -> "))));
        }
    }
    Ok(findings)
}

/// Resolved dependencies by package id, without those of tests.
fn edges(metadata: &Value) -> Result<BTreeMap<&str, Vec<&str>>, XtaskError> {
    let mut edges = BTreeMap::new();
    for node in array(metadata.get("resolve").unwrap_or(&Value::Null), "nodes")? {
        let mut to = Vec::new();
        for dependency in array(node, "deps")? {
            let kinds = array(dependency, "dep_kinds")?;
            if kinds.iter().any(|kind| kind.get("kind").and_then(Value::as_str) != Some("dev")) {
                to.push(string(dependency, "pkg")?);
            }
        }
        edges.insert(string(node, "id")?, to);
    }
    Ok(edges)
}

/// The shortest chain of package names from `from` to a package of [`DEVICE`].
fn path_to_device<'a>(
    from: &'a str,
    edges: &BTreeMap<&'a str, Vec<&'a str>>,
    names: &BTreeMap<&'a str, &'a str>,
) -> Option<Vec<&'a str>> {
    let name = |id: &'a str| names.get(id).copied().unwrap_or(id);
    let mut before: BTreeMap<&str, Option<&'a str>> = BTreeMap::from([(from, None)]);
    let mut level = vec![from];
    while !level.is_empty() {
        let mut next = Vec::new();
        for id in level {
            if DEVICE.contains(&name(id)) {
                let mut path: Vec<&'a str> =
                    std::iter::successors(Some(id), |id| before.get(id).copied().flatten()).map(name).collect();
                path.reverse();
                return Some(path);
            }
            for &to in edges.get(id).into_iter().flatten() {
                if !before.contains_key(to) {
                    before.insert(to, Some(id));
                    next.push(to);
                }
            }
        }
        level = next;
    }
    None
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// Metadata of a workspace whose members are those named omnix or xtask; an edge is (from, to, kind).
    fn metadata_of(edges: &[(&str, &str, Option<&str>)]) -> Value {
        let names: BTreeSet<&str> = edges.iter().flat_map(|(from, to, _)| [*from, *to]).collect();
        let of = |name: &str| edges.iter().filter(move |(from, _, _)| *from == name).copied().collect::<Vec<_>>();
        let ours = names.iter().filter(|name| name.starts_with("omnix") || **name == "xtask");
        json!({
            "workspace_members": ours.collect::<Vec<_>>(),
            "packages": names.iter().map(|name| json!({
                "id": name, "name": name,
                "dependencies": of(name).iter().map(|(_, to, kind)| json!({"name": to, "kind": kind})).collect::<Vec<_>>(),
            })).collect::<Vec<_>>(),
            "resolve": {"nodes": names.iter().map(|name| json!({
                "id": name,
                "deps": of(name).iter().map(|(_, to, kind)| json!({"pkg": to, "dep_kinds": [{"kind": kind}]})).collect::<Vec<_>>(),
            })).collect::<Vec<_>>()},
        })
    }

    fn messages(edges: &[(&str, &str, Option<&str>)]) -> Vec<String> {
        check(&metadata_of(edges)).unwrap().into_iter().map(|finding| finding.to_string()).collect()
    }

    #[test]
    fn arrows_down_pass() {
        let down = [
            ("omnix-cli", "omnix", None),
            ("omnix", "omnix-model", None),
            ("omnix-model", "omnix-graph", None),
            ("omnix-graph", "wgpu", None),
            ("omnix-io", "omnix-geometry", None),
            ("omnix-tests", "xtask", Some("dev")),
        ];
        assert_eq!(messages(&down), Vec::<String>::new());
    }

    #[test]
    fn arrows_up_fail_whatever_their_kind() {
        for kind in [None, Some("dev"), Some("build")] {
            for (from, to) in [
                ("omnix-graph", "omnix-model"),
                ("omnix-geometry", "omnix-io"),
                ("omnix-tests", "omnix-cli"),
                ("omnix", "omnix-cli"),
            ] {
                let found = messages(&[(from, to, kind)]);
                assert_eq!(found.len(), 1, "{found:?}");
                assert!(found[0].starts_with(&format!("error: {from}: must not depend on {to}")), "{found:?}");
            }
        }
    }

    #[test]
    fn a_device_is_found_through_others_but_not_through_tests() {
        let found = messages(&[("omnix-io", "viewer", None), ("viewer", "wgpu", Some("build"))]);
        assert_eq!(found, ["error: omnix-io: must not reach wgpu: omnix-io -> viewer -> wgpu"]);
        assert_eq!(messages(&[("omnix-io", "viewer", Some("dev")), ("viewer", "wgpu", None)]), Vec::<String>::new());
    }

    #[test]
    fn a_new_package_must_be_given_its_arrows() {
        assert!(messages(&[("omnix-else", "serde", None)])[0].contains("without arrows"));
    }

    #[test]
    fn other_json_is_an_error() {
        assert!(matches!(check(&json!({})), Err(XtaskError::Metadata { .. })));
    }
}
