//! No circle of imports between the files of a crate: what knows what has one direction, so that a file can be read, moved
//! and tested with what lies below it.
//!
//! A file imports another when a `use` or a path in it leads to something that the other defines, through however many
//! re-exports. Declaring a module imports nothing, and neither does re-exporting what is a child's: a `lib.rs` or `mod.rs`
//! that does nothing else is part of no circle. Calls of methods are not seen, and unit tests inside of a file do not count.

mod known;
mod modules;
mod source;

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use self::known::KNOWN;
use self::modules::{Imports, Modules};
use self::source::Scope;
use crate::{Finding, Tree};

/// No circle of imports in any crate of the tree but the known ones. `roots` are the root files of the crates: of
/// libraries, programs, tests, benches, examples and build scripts.
pub fn check(tree: &Tree, roots: &[String]) -> Vec<Finding> {
    check_but(tree, roots, KNOWN)
}

fn check_but(tree: &Tree, roots: &[String], known: &[(&str, &str)]) -> Vec<Finding> {
    let mut findings = Vec::new();
    let mut sources = BTreeMap::new();
    for (path, text) in tree.files().filter(|(path, _)| path.ends_with(".rs")) {
        match Scope::read(text) {
            Ok(scope) => _ = sources.insert(path.to_owned(), scope),
            Err(error) => findings.push(Finding::error(path, format!("is no Rust: {error}"))),
        }
    }
    let mut removed = BTreeSet::new();
    // A file that several crates take in may give the same circle in each.
    let mut circles = BTreeSet::new();
    for root in roots {
        if !sources.contains_key(root) {
            findings.push(Finding::error(root, "the root of a crate was not read: its imports are not checked"));
        }
        let imports = Modules::of(root, &sources).imports();
        let in_circles: BTreeSet<(String, String)> = knots(&imports)
            .iter()
            .flat_map(|knot| {
                imports.keys().filter(|(from, to)| knot.contains(from.as_str()) && knot.contains(to.as_str())).cloned()
            })
            .collect();
        let is_known = |(from, to): &(String, String)| known.contains(&(from.as_str(), to.as_str()));
        removed.extend(in_circles.into_iter().filter(is_known));
        let unknown: Imports = imports.into_iter().filter(|(pair, _)| !is_known(pair)).collect();
        circles.extend(knots(&unknown).iter().map(|knot| describe(&unknown, knot)));
    }
    findings.extend(circles.into_iter().map(|(place, message)| Finding::error(place, message)));
    let gone = known.iter().filter(|(from, to)| !removed.contains(&((*from).to_owned(), (*to).to_owned())));
    findings.extend(gone.map(|(from, to)| {
        let message = format!(
            "its import of {to} is part of no circle any more: delete its line in tools/xtask/src/circles/known.rs"
        );
        Finding::error(*from, message)
    }));
    findings
}

/// The sets of files that all reach one another by imports, of two files and more.
fn knots(imports: &Imports) -> Vec<BTreeSet<&str>> {
    let files: BTreeSet<&str> = imports.keys().flat_map(|(from, to)| [from.as_str(), to.as_str()]).collect();
    let reached: BTreeMap<&str, BTreeSet<&str>> = files.iter().map(|&file| (file, reach(imports, file))).collect();
    let together = |a: &str, b: &str| reached[a].contains(b) && reached[b].contains(a);
    let mut knots: Vec<BTreeSet<&str>> = Vec::new();
    for &file in &files {
        if reached[file].contains(file) && !knots.iter().any(|knot| knot.contains(file)) {
            knots.push(files.iter().copied().filter(|&other| together(file, other)).collect());
        }
    }
    knots
}

/// All files that imports lead to from `file`; the file itself only where they come back to it.
fn reach<'a>(imports: &'a Imports, file: &str) -> BTreeSet<&'a str> {
    let mut reached = BTreeSet::new();
    let mut next: Vec<&str> = targets(imports, file).collect();
    while let Some(file) = next.pop() {
        if reached.insert(file) {
            next.extend(targets(imports, file));
        }
    }
    reached
}

fn targets<'a>(imports: &'a Imports, file: &str) -> impl Iterator<Item = &'a str> {
    imports.keys().filter(move |(from, _)| from == file).map(|(_, to)| to.as_str())
}

/// The shortest circle of a knot, each file with the lines of its import, and how many files hang together in all.
fn describe(imports: &Imports, knot: &BTreeSet<&str>) -> (String, String) {
    let circle = knot.iter().map(|file| shortest(imports, knot, file)).min_by_key(Vec::len).unwrap_or_default();
    let steps = circle.iter().zip(circle.iter().cycle().skip(1)).map(|(from, to)| {
        let lines = imports.get(&((*from).to_owned(), (*to).to_owned())).into_iter().flatten();
        let lines: Vec<String> = lines.map(ToString::to_string).collect();
        format!("{from}:{} imports {to}", lines.join(","))
    });
    let steps: Vec<String> = steps.collect();
    let more = if knot.len() > circle.len() {
        format!(" (the shortest circle of {} files that all reach one another)", knot.len())
    } else {
        String::new()
    };
    let message = format!(
        "circle of imports: {}{more}: move what both sides need into a file that knows neither",
        steps.join("; ")
    );
    (circle.first().copied().unwrap_or_default().to_owned(), message)
}

/// The files of the shortest way from `start` back to it, inside of `knot`.
fn shortest<'a>(imports: &'a Imports, knot: &BTreeSet<&'a str>, start: &'a str) -> Vec<&'a str> {
    let mut before: BTreeMap<&str, &str> = BTreeMap::new();
    let mut queue = VecDeque::from([start]);
    while let Some(file) = queue.pop_front() {
        for to in targets(imports, file).filter(|to| knot.contains(to)) {
            if to == start {
                let back = std::iter::successors(Some(file), |file| before.get(file).copied());
                let mut circle: Vec<&str> = back.collect();
                circle.reverse();
                return circle;
            }
            if !before.contains_key(to) {
                before.insert(to, file);
                queue.push_back(to);
            }
        }
    }
    Vec::new()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Findings of a crate `c` of these files (paths below `c/`), its root `lib.rs`.
    fn findings_but(files: &[(&str, &str)], known: &[(&str, &str)]) -> Vec<String> {
        let files: Vec<(String, &str)> = files.iter().map(|(path, text)| (format!("c/{path}"), *text)).collect();
        let tree = Tree::from_files(files.iter().map(|(path, text)| (path.as_str(), *text)));
        check_but(&tree, &["c/lib.rs".to_owned()], known).iter().map(ToString::to_string).collect()
    }

    fn findings(files: &[(&str, &str)]) -> Vec<String> {
        findings_but(files, &[])
    }

    const LIB: (&str, &str) = ("lib.rs", "mod a;\nmod b;\npub use a::A;\npub use b::B;\n");

    #[test]
    fn a_planted_circle_is_named_with_files_and_lines() {
        let circle =
            [LIB, ("a.rs", "//! a\nuse crate::b::B;\npub struct A(B);"), ("b.rs", "pub struct B(crate::a::A);")];
        assert_eq!(
            findings(&circle),
            ["error: c/a.rs: circle of imports: c/a.rs:2 imports c/b.rs; c/b.rs:1 imports c/a.rs: \
              move what both sides need into a file that knows neither"]
        );
        let open = [LIB, circle[1], ("b.rs", "pub struct B(u8);")];
        assert_eq!(findings(&open), [""; 0]);
    }

    #[test]
    fn every_way_to_import_counts() {
        // Each of these in a.rs, while b.rs imports A.
        let ways = [
            "use super::b::B;",
            "use crate::{b::{B as Other}};",
            "use crate::B;",
            "use crate::b; fn f() -> b::B { b::B }",
            "use crate::b;",
            "use crate::b::*; fn f(_: B) {}",
            "use crate::*; fn f(_: B) {}",
            "fn f() { crate::b::B::new() }",
            "fn f(x: Vec<super::B>) {}",
            "fn f() { assert!(matches!(x, crate::b::B)) }",
            "mod inner { use super::super::b::B; }",
            "fn f() { use crate::b::B; }",
            "pub use crate::b::B as C;",
        ];
        for way in ways {
            let text = format!("{way} pub struct A;");
            let found = findings(&[LIB, ("a.rs", &text), ("b.rs", "use crate::A; pub struct B(A);")]);
            assert_eq!(found.len(), 1, "{way}: {found:?}");
        }
        for harmless in
            ["use b::B;", "use ::b::B;", "#[cfg(test)] mod tests { use crate::b::B; }", "pub(in crate::b) fn f() {}"]
        {
            let text = format!("{harmless} pub struct A;");
            let found = findings(&[LIB, ("a.rs", &text), ("b.rs", "use crate::A; pub struct B(A);")]);
            assert_eq!(found, [""; 0], "{harmless}");
        }
    }

    #[test]
    fn parent_and_child_make_a_circle_only_by_what_they_use() {
        let child = ("a/child.rs", "use super::Shared; pub fn f(_: Shared) {}");
        let parents = [
            ("mod child; pub use child::f; pub struct Shared;", 0),
            ("mod child; pub use child::*; pub struct Shared;", 0),
            ("mod child; pub use child::f; pub struct Shared; fn g() { f(Shared) }", 1),
            ("mod child; pub use child::*; pub struct Shared; fn g() { f(Shared) }", 1),
            ("mod child; pub struct Shared; fn g() { child::f(Shared) }", 1),
            ("mod child; use child::f; pub struct Shared;", 1),
            ("mod child; mod shared; pub use shared::Shared; fn g() { child::f(Shared) }", 0),
        ];
        for (parent, expected) in parents {
            let files = [("lib.rs", "mod a;"), ("a.rs", parent), child, ("a/shared.rs", "pub struct Shared;")];
            assert_eq!(findings(&files).len(), expected, "{parent}: {:?}", findings(&files));
        }
    }

    #[test]
    fn a_longer_circle_is_told_by_its_shortest_and_its_size() {
        let found = findings(&[
            ("lib.rs", "mod a; mod b; mod d;"),
            ("a.rs", "use crate::b::B; pub struct A;"),
            ("b.rs", "use crate::a::A; use crate::d::D; pub struct B;"),
            ("d.rs", "use crate::a::A; pub struct D;"),
        ]);
        assert_eq!(found.len(), 1);
        assert!(
            found[0].contains("c/a.rs:1 imports c/b.rs; c/b.rs:1 imports c/a.rs (the shortest circle of 3 files"),
            "{found:?}"
        );
    }

    #[test]
    fn known_circles_pass_until_they_are_gone() {
        let a = ("a.rs", "use crate::b::B; pub struct A;");
        let circle = [LIB, a, ("b.rs", "use crate::a::A; pub struct B;")];
        let known = [("c/b.rs", "c/a.rs")];
        assert_eq!(findings_but(&circle, &known), [""; 0]);
        assert_eq!(findings_but(&circle, &[]).len(), 1);
        let gone = findings_but(&[LIB, a, ("b.rs", "pub struct B;")], &known);
        assert_eq!(
            gone,
            [
                "error: c/b.rs: its import of c/a.rs is part of no circle any more: delete its line in tools/xtask/src/circles/known.rs"
            ]
        );
    }

    #[test]
    fn a_root_that_is_not_there_is_named() {
        assert!(
            findings(&[("other.rs", "mod a;")])[0].starts_with("error: c/lib.rs: the root of a crate was not read")
        );
    }

    #[test]
    fn text_that_is_no_rust_is_named() {
        assert!(findings(&[("lib.rs", "fn f( {")])[0].starts_with("error: c/lib.rs: is no Rust"));
    }
}
