//! Says whether `../shared` lies beside the project, as `cfg(shared)`: tests of what is there alone are ignored elsewhere, with that
//! reason, so that a clone by itself shows what it did not run.

fn main() {
    let shared = concat!(env!("CARGO_MANIFEST_DIR"), "/../../shared");
    println!("cargo::rustc-check-cfg=cfg(shared)");
    println!("cargo::rerun-if-changed={shared}");
    if std::path::Path::new(shared).is_dir() {
        println!("cargo::rustc-cfg=shared");
    }
}
