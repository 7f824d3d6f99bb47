//! One name, seven places: a kernel `k` has its WGSL, its host side, its CPU oracle, its cases, its test, its bench, and the
//! operation of graphs that it computes.

use std::collections::BTreeSet;

use crate::{Finding, Tree};

/// Folders below `shaders/` that are no kernels.
const NO_KERNELS: [&str; 4] = ["check", "compose", "lib", "src"];
/// Files beside the kernels' own in the other places: module roots, what the tests or benches of several share, and the
/// tests of the device and of all kernels' memory layouts and bounds.
const NO_KERNEL_FILES: [&str; 8] = ["bounds", "case", "common", "device", "layout", "main", "mod", "support"];

/// Folders whose every file belongs to the kernel of its name.
const OWNED: [&str; 4] = ["crates/omnix-kernels/src/cpu", "tests/harness/cases", "tests/kernels", "benches/kernels"];

/// Where the operation of a kernel is stated.
const OPERATIONS: &str = "crates/omnix-graph/src/ops";
/// Kernels that compute an operation of another name: Winograd's algorithm is one of `conv2d`'s, and of `conv2d_weights`'.
const ALGORITHMS: [&str; 2] = ["winograd", "winograd_weights"];

/// Every kernel is in its seven places, and no test, bench or oracle lacks its kernel.
pub fn check(tree: &Tree) -> Vec<Finding> {
    let kernels: BTreeSet<&str> =
        tree.folders("shaders").into_iter().filter(|name| !NO_KERNELS.contains(name)).collect();
    let mut findings = Vec::new();
    for kernel in &kernels {
        let shader = [format!("shaders/{kernel}/{kernel}.wgsl"), format!("shaders/{kernel}/{kernel}.toml")];
        if !shader.iter().any(|path| tree.has(path)) {
            findings.push(missing(kernel, &shader[0]));
        }
        let host = format!("crates/omnix-kernels/src/{kernel}.rs");
        let others = OWNED.iter().map(|folder| format!("{folder}/{kernel}.rs"));
        let operation = (!ALGORITHMS.contains(kernel)).then(|| format!("{OPERATIONS}/{kernel}.rs"));
        findings.extend(
            std::iter::once(host)
                .chain(others)
                .chain(operation)
                .filter(|path| !tree.has(path))
                .map(|path| missing(kernel, &path)),
        );
    }
    for folder in OWNED {
        let strays = tree.rust_stems(folder).filter(|stem| !kernels.contains(stem) && !NO_KERNEL_FILES.contains(stem));
        findings.extend(strays.map(|stem| {
            Finding::error(
                format!("{folder}/{stem}.rs"),
                format!("no kernel shaders/{stem}/: give the file its kernel's name, or move shared code to {folder}/common.rs"),
            )
        }));
    }
    findings
}

fn missing(kernel: &str, path: &str) -> Finding {
    Finding::error(
        path,
        format!("missing: kernel `{kernel}` must be in seven places (CONTRIBUTING.md, \"Add a kernel\")"),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHOLE: [&str; 7] = [
        "shaders/gelu/gelu.wgsl",
        "crates/omnix-kernels/src/gelu.rs",
        "crates/omnix-kernels/src/cpu/gelu.rs",
        "tests/harness/cases/gelu.rs",
        "tests/kernels/gelu.rs",
        "benches/kernels/gelu.rs",
        "crates/omnix-graph/src/ops/gelu.rs",
    ];

    fn findings<'a>(paths: impl IntoIterator<Item = &'a str>) -> Vec<String> {
        let tree = Tree::from_files(paths.into_iter().map(|path| (path, "")));
        check(&tree).into_iter().map(|finding| finding.place).collect()
    }

    #[test]
    fn a_whole_kernel_passes() {
        let beside = [
            "shaders/lib/grid.wgsl",
            "shaders/src/lib.rs",
            "shaders/build.rs",
            "tests/kernels/main.rs",
            "tests/kernels/common.rs",
            "tests/harness/cases/case.rs",
        ];
        assert_eq!(findings(WHOLE.into_iter().chain(beside)), Vec::<String>::new());
        assert_eq!(
            findings(
                ["shaders/gelu/gelu.toml", "shaders/gelu/fast.wgsl"].into_iter().chain(WHOLE[1..].iter().copied())
            ),
            Vec::<String>::new()
        );
    }

    #[test]
    fn each_missing_place_is_named() {
        for left_out in &WHOLE[1..] {
            assert_eq!(findings(WHOLE.into_iter().filter(|path| path != left_out)), [*left_out]);
        }
        assert_eq!(findings(["shaders/gelu/other.wgsl"].into_iter().chain(WHOLE[1..].iter().copied())), [WHOLE[0]]);
    }

    #[test]
    fn a_place_without_its_kernel_is_named() {
        let strays =
            findings(WHOLE.into_iter().chain(["tests/kernels/relu.rs", "crates/omnix-kernels/src/cpu/relu.rs"]));
        assert_eq!(strays, ["crates/omnix-kernels/src/cpu/relu.rs", "tests/kernels/relu.rs"]);
    }
}
