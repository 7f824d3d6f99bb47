//! A dependency that a Cargo.toml names is used by that package: it costs everyone who builds it.

use std::path::Path;

use serde_json::Value;

use crate::metadata::{array, is_member, relative, string};
use crate::{Finding, Tree, XtaskError};

/// Code of a workspace's package goes into every crate that it depends on.
///
/// # Errors
/// [`XtaskError::Metadata`] when `metadata` lacks a field.
pub fn check(metadata: &Value, tree: &Tree, root: &Path) -> Result<Vec<Finding>, XtaskError> {
    let mut findings = Vec::new();
    for package in array(metadata, "packages")?.iter().filter(|package| is_member(metadata, package)) {
        let Some(manifest) = relative(string(package, "manifest_path")?, root) else {
            continue;
        };
        let mut folders = vec![folder(&manifest)];
        let targets = array(package, "targets")?.iter().filter_map(|target| target.get("src_path")?.as_str());
        // A test of the program lies beside the other tests.
        let roots: Vec<String> = targets.filter_map(|path| relative(path, root)).collect();
        folders.extend(roots.iter().map(|path| folder(path)));
        let ours = |path: &str| path.ends_with(".rs") && folders.iter().any(|folder| path.starts_with(folder));
        for dependency in array(package, "dependencies")? {
            let name = string(dependency, "name")?;
            let word = dependency.get("rename").and_then(Value::as_str).unwrap_or(name).replace('-', "_");
            if !tree.files().any(|(path, text)| ours(path) && text.lines().any(|line| uses(line, &word))) {
                findings.push(Finding::error(
                    &manifest,
                    format!("`{name}` is used nowhere in this package: take the dependency out"),
                ));
            }
        }
    }
    Ok(findings)
}

/// The folder that a file lies in, with its `/`.
fn folder(path: &str) -> &str {
    path.rfind('/').map_or("", |end| &path[..=end])
}

/// Is there code on this line that goes into the crate `name`: `name::`, `name!`, `use name;` or `use name as`?
fn uses(line: &str, name: &str) -> bool {
    let code = line.split("//").next().unwrap_or_default();
    code.match_indices(name).any(|(at, _)| {
        let (before, after) = (&code[..at], &code[at + name.len()..]);
        let whole = !before.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        let imported = before.trim_end().ends_with("use") && (after.starts_with(';') || after.starts_with(" as "));
        whole && (after.starts_with("::") || after.starts_with('!') || imported)
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn a_dependency_that_no_code_of_the_package_goes_into_is_found() {
        let metadata = json!({"workspace_members": ["a"], "packages": [
            {"id": "a", "manifest_path": "/r/crates/a/Cargo.toml",
             "targets": [{"src_path": "/r/crates/a/src/lib.rs"}, {"src_path": "/r/tests/a/main.rs"}],
             "dependencies": [{"name": "used-one"}, {"name": "left", "rename": "right"}, {"name": "tested"},
                              {"name": "half"}, {"name": "told"}, {"name": "gone"}]},
            {"id": "foreign", "manifest_path": "/elsewhere/Cargo.toml", "dependencies": [{"name": "gone"}]},
        ]});
        let tree = Tree::from_files([
            ("crates/a/src/lib.rs", "use used_one::X;\nfn f() { right::g(half, before_half::x) } // told::y"),
            ("tests/a/part/deep.rs", "use tested as t;"),
            ("crates/ab/src/lib.rs", "use gone::X;"),
        ]);
        let found = check(&metadata, &tree, Path::new("/r")).unwrap();
        let found: Vec<String> = found.iter().map(ToString::to_string).collect();
        assert_eq!(
            found,
            ["half", "told", "gone"].map(|name| format!(
                "error: crates/a/Cargo.toml: `{name}` is used nowhere in this package: take the dependency out"
            ))
        );
    }
}
