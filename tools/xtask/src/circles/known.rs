//! Imports that close a circle and are still to be removed.

/// (Importing file, imported file). Whoever removes one deletes its line: a line that is part of no circle any more fails the
/// check. No line is ever added.
pub(super) const KNOWN: &[(&str, &str)] = &[
    ("crates/omnix-cli/src/args.rs", "crates/omnix-cli/src/cmd/bench.rs"),
    ("crates/omnix-cli/src/args.rs", "crates/omnix-cli/src/cmd/plan.rs"),
    ("crates/omnix-cli/src/args.rs", "crates/omnix-cli/src/cmd/query.rs"),
    ("crates/omnix-cli/src/args.rs", "crates/omnix-cli/src/cmd/reconstruct.rs"),
    ("crates/omnix-io/src/input/sources.rs", "crates/omnix-io/src/input/mod.rs"),
    ("crates/omnix-io/src/output/html/meta.rs", "crates/omnix-io/src/output/html.rs"),
    ("crates/omnix-io/src/output/mod.rs", "crates/omnix-io/src/output/depth.rs"),
    ("crates/omnix-io/src/output/mod.rs", "crates/omnix-io/src/output/glb.rs"),
    ("crates/omnix-io/src/output/mod.rs", "crates/omnix-io/src/output/npz.rs"),
    ("crates/omnix-io/src/output/mod.rs", "crates/omnix-io/src/output/ply.rs"),
    ("crates/omnix-io/src/output/mod.rs", "crates/omnix-io/src/output/tum.rs"),
];
