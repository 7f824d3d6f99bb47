//! What every text file keeps to: its length, its first line, and nothing left over from writing it.

use crate::{Finding, Tree};

/// Lines of a Rust or WGSL file from which it is worth splitting, and from which it must be.
const LONG: usize = 500;
const TOO_LONG: usize = 600;

/// Lines that a text for people may have: what is longer is not read. A path that begins so, and its limit; the first that
/// fits counts. The log of measurements is not meant to be read through.
const PROSE: [(&str, usize); 3] = [("benches/log/", usize::MAX), ("BENCHMARKS.md", 120), ("", 300)];

// Written in two pieces, so that this file passes its own check.
const MARKERS: [&str; 4] =
    [concat!("TO", "DO"), concat!("FIX", "ME"), concat!("to", "do!"), concat!("unimple", "mented!")];
/// Folders of one machine, which mean nothing on another.
const MACHINE_PATHS: [&str; 2] = [concat!("/wo", "rk/"), concat!("/ro", "ot/")];

/// Loops of WGSL whose end is not in their head. Shaders are made without wgpu's loop counters (`omnix-kernels`, `device/gpu.rs`).
const ENDLESS: [&str; 2] = ["loop", "while"];

/// Files that texts and comments refer to by a path that begins so: each must be there.
const REFERRED: &str = "benches/log/";

/// Length and first line of each Rust and WGSL file, loops of WGSL, leftovers in all files, and references to measurements.
pub fn check(tree: &Tree) -> Vec<Finding> {
    let mut findings: Vec<Finding> = tree.files().flat_map(|(path, text)| check_file(path, text)).collect();
    for (path, text) in tree.files() {
        for (number, line) in text.lines().enumerate() {
            let missing = references(line).find(|name| !tree.has(name));
            findings.extend(missing.map(|name| {
                Finding::error(format!("{path}:{}", number + 1), format!("refers to {name}, which is not there"))
            }));
        }
    }
    findings
}

/// The Markdown files below [`REFERRED`] that a line names.
fn references(line: &str) -> impl Iterator<Item = &str> {
    line.match_indices(REFERRED).filter_map(|(start, _)| {
        let rest = &line[start..];
        let end = rest.find(".md").map(|at| at + ".md".len())?;
        rest[..end].chars().all(|c| c.is_alphanumeric() || "/-._".contains(c)).then(|| &rest[..end])
    })
}

fn check_file(path: &str, text: &str) -> Vec<Finding> {
    let mut findings = Vec::new();
    let rust = path.ends_with(".rs");
    if rust || path.ends_with(".wgsl") {
        let lines = text.lines().count();
        if lines > TOO_LONG {
            findings.push(Finding::error(path, format!("{lines} lines, {TOO_LONG} allowed: split it by subject")));
        } else if lines > LONG {
            findings.push(Finding::warning(
                path,
                format!("{lines} lines: split it by subject before it reaches {TOO_LONG}"),
            ));
        }
        let header = if rust { "//!" } else { "//" };
        if !text.starts_with(header) {
            findings.push(Finding::error(path, format!("must start with `{header}` and say what the file is")));
        }
    }
    if path.ends_with(".md") {
        let lines = text.lines().count();
        let limit = PROSE.iter().find(|(start, _)| path.starts_with(start)).map_or(usize::MAX, |(_, limit)| *limit);
        if lines > limit {
            findings.push(Finding::error(path, format!("{lines} lines, {limit} allowed: split it by subject")));
        }
    }
    for (number, line) in text.lines().enumerate() {
        let at = || format!("{path}:{}", number + 1);
        let code = line.split("//").next().unwrap_or_default();
        if path.ends_with(".wgsl")
            && let Some(word) = ENDLESS.iter().find(|word| has_word(code, word))
        {
            let message = format!("`{word}`: loops are `for` and count to a bound, wgpu is not asked to end them");
            findings.push(Finding::error(at(), message));
        }
        if path.ends_with(".wgsl")
            && code.contains("for (")
            && code.split(';').filter(|part| !part.trim_matches([' ', '(', ')', '{']).is_empty()).count() < 3
        {
            findings.push(Finding::error(at(), "a `for` has its start, its bound and its step on one line"));
        }
        // Prose may speak of the markers.
        if !path.ends_with(".md")
            && let Some(marker) = MARKERS.iter().find(|marker| has_word(line, marker))
        {
            findings.push(Finding::error(at(), format!("`{marker}`: finish it, or file an issue and leave it out")));
        }
        if let Some(found) = MACHINE_PATHS.iter().find(|found| line.contains(**found)) {
            findings.push(Finding::error(
                at(),
                format!("`{found}` is a folder of one machine: name it relative to the repository"),
            ));
        }
    }
    findings
}

/// Does `line` have `word` with no letter, digit or underscore on either side?
fn has_word(line: &str, word: &str) -> bool {
    let part = |c: char| c.is_alphanumeric() || c == '_';
    line.match_indices(word).any(|(at, _)| {
        let before = line[..at].chars().next_back();
        let after = line[at + word.len()..].chars().next();
        // After the exclamation mark of a macro anything may follow.
        !before.is_some_and(part) && (word.ends_with('!') || !after.is_some_and(part))
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Level;

    fn levels(path: &str, text: &str) -> Vec<Level> {
        check_file(path, text).into_iter().map(|finding| finding.level).collect()
    }

    #[test]
    fn length_warns_then_fails() {
        let file = |lines: usize| "//! x\n".to_owned() + &"//\n".repeat(lines - 1);
        assert_eq!(levels("a.rs", &file(500)), []);
        assert_eq!(levels("a.rs", &file(501)), [Level::Warning]);
        assert_eq!(levels("a.wgsl", &file(600)), [Level::Warning]);
        assert_eq!(levels("a.wgsl", &file(601)), [Level::Error]);
    }

    #[test]
    fn references_to_measurements_lead_somewhere() {
        let comment = format!("//! x\n// slower ({REFERRED}here.md, \"Limits\").\n// [b]({REFERRED}gone.md)\n");
        let tree = Tree::from_files([("a.rs", comment.as_str()), (concat!("benches/log/", "here.md"), "")]);
        let found: Vec<String> = check(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(found, [concat!("error: a.rs:3: refers to benches/log/", "gone.md, which is not there")]);
    }

    #[test]
    fn texts_for_people_are_short() {
        let lines = |lines: usize| "text\n".repeat(lines);
        assert_eq!(levels("crates/x/README.md", &lines(300)), []);
        assert_eq!(levels("crates/x/README.md", &lines(301)), [Level::Error]);
        assert_eq!(levels("BENCHMARKS.md", &lines(120)), []);
        assert_eq!(levels("BENCHMARKS.md", &lines(121)), [Level::Error]);
        assert_eq!(levels("benches/log/2026-11-29-zen-4.md", &lines(1000)), []);
    }

    #[test]
    fn a_file_says_what_it_is() {
        assert_eq!(levels("a.rs", "// plain\n"), [Level::Error]);
        assert_eq!(levels("a.rs", ""), [Level::Error]);
        assert_eq!(levels("a.wgsl", "// plain\n"), []);
        assert_eq!(levels("a.wgsl", "\n// late\n"), [Level::Error]);
    }

    #[test]
    fn leftovers_are_found_as_words() {
        for marker in MARKERS {
            assert_eq!(levels("a.toml", &format!("# {marker} later")), [Level::Error], "{marker}");
            assert_eq!(levels("a.toml", &format!("# x{marker}")), [], "{marker}");
        }
        assert_eq!(levels("a.toml", &format!("# {}S", MARKERS[0])), []);
        assert_eq!(levels("a.md", MARKERS[0]), []);
    }

    #[test]
    fn loops_of_shaders_have_an_end() {
        let file = |code: &str| format!("// x\n{code}\n");
        assert_eq!(levels("a.wgsl", &file("    for (var i = 0u; i < n; i++) { // a loop")), []);
        for code in ["    loop {", "    while (low < high) {"] {
            assert_eq!(levels("a.wgsl", &file(code)), [Level::Error], "{code}");
            assert_eq!(levels("a.rs", &format!("//! x\n{code}\n")), []);
        }
        for code in ["    for (;;) {", "    for (var i = 0u; ; i++) {", "    for (var i = 0u; i < n;) {"] {
            assert_eq!(levels("a.wgsl", &file(code)), [Level::Error], "{code}");
        }
    }

    #[test]
    fn paths_of_one_machine_are_found() {
        assert_eq!(levels("a.md", &format!("see {}x", MACHINE_PATHS[0])), [Level::Error]);
        assert_eq!(levels("a.md", "see ../shared/x and a framework"), []);
    }
}
