//! What `cargo metadata` says of the workspace (its JSON: The Cargo Book, "cargo metadata").

use std::path::{Component, Path};
use std::process::Command;

use serde_json::Value;

use crate::XtaskError;

/// What `cargo metadata` says of the workspace at `root`, for the platform of this machine.
///
/// # Errors
/// [`XtaskError`] when cargo cannot be run, fails (an outdated Cargo.lock too) or prints no JSON.
pub fn read(root: &Path) -> Result<Value, XtaskError> {
    let rustc = run(Command::new(std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into())).arg("-vV"))?;
    let host = rustc.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.ok_or_else(|| XtaskError::Metadata { what: "rustc -vV names no host".to_owned() })?;
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    // One platform: crates of the others need not be downloaded.
    let text = run(Command::new(cargo)
        .args(["metadata", "--format-version", "1", "--locked", "--all-features", "--filter-platform", host])
        .current_dir(root))?;
    serde_json::from_str(&text).map_err(|error| XtaskError::Metadata { what: error.to_string() })
}

/// Root files of all crates of the workspace's packages: libraries, programs, tests, benches, examples, build scripts.
/// Relative to `root`, with `/`, sorted.
///
/// # Errors
/// [`XtaskError::Metadata`] when `metadata` lacks a field.
pub fn roots(metadata: &Value, root: &Path) -> Result<Vec<String>, XtaskError> {
    let mut roots = Vec::new();
    for package in array(metadata, "packages")?.iter().filter(|package| is_member(metadata, package)) {
        for target in array(package, "targets")? {
            roots.extend(relative(string(target, "src_path")?, root));
        }
    }
    roots.sort();
    roots.dedup();
    Ok(roots)
}

/// Is this package one of the workspace's own?
pub(crate) fn is_member(metadata: &Value, package: &Value) -> bool {
    let members = metadata.get("workspace_members").and_then(Value::as_array);
    members.is_some_and(|members| package.get("id").is_some_and(|id| members.contains(id)))
}

/// `path` relative to `root`, with `/`. Cargo hands on the `..` of a manifest's paths; they are taken out.
pub(crate) fn relative(path: &str, root: &Path) -> Option<String> {
    let inside = Path::new(path).strip_prefix(root).ok()?;
    let mut parts = Vec::new();
    for part in inside.components() {
        match part {
            Component::ParentDir => _ = parts.pop()?,
            Component::Normal(name) => parts.push(name.to_string_lossy()),
            Component::CurDir | Component::RootDir | Component::Prefix(_) => {}
        }
    }
    Some(parts.join("/"))
}

fn run(command: &mut Command) -> Result<String, XtaskError> {
    let name = || {
        format!(
            "{} {}",
            command.get_program().display(),
            command.get_args().map(|a| a.to_string_lossy()).collect::<Vec<_>>().join(" ")
        )
    };
    let line = name();
    let output = command.output().map_err(|source| XtaskError::Command { command: line.clone(), source })?;
    if !output.status.success() {
        let stderr = String::from_utf8_lossy(&output.stderr).trim().to_owned();
        return Err(XtaskError::CommandFailed { command: line, stderr });
    }
    Ok(String::from_utf8_lossy(&output.stdout).into_owned())
}

pub(crate) fn array<'a>(value: &'a Value, field: &str) -> Result<&'a Vec<Value>, XtaskError> {
    let found = value.get(field).and_then(Value::as_array);
    found.ok_or_else(|| XtaskError::Metadata { what: format!("no array `{field}`") })
}

pub(crate) fn string<'a>(value: &'a Value, field: &str) -> Result<&'a str, XtaskError> {
    let found = value.get(field).and_then(Value::as_str);
    found.ok_or_else(|| XtaskError::Metadata { what: format!("no string `{field}`") })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn roots_are_those_of_members_with_no_way_up_in_them() {
        let target = |path: &str| json!({"src_path": path});
        let metadata = json!({"workspace_members": ["a"], "packages": [
            {"id": "a", "targets": [target("/r/crates/a/src/lib.rs"), target("/r/crates/a/../../tests/cli/main.rs")]},
            {"id": "foreign", "targets": [target("/r/vendor/lib.rs")]},
        ]});
        assert_eq!(roots(&metadata, Path::new("/r")).unwrap(), ["crates/a/src/lib.rs", "tests/cli/main.rs"]);
    }
}
