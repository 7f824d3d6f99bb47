//! Says whether `../shared` lies beside the project (or where `OMNIX_SHARED` says), as `cfg(shared)` and as its path in the variable
//! `OMNIX_SHARED`: tests of what is there alone are ignored elsewhere, with that reason.

fn main() {
    let beside = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared");
    let shared = std::env::var("OMNIX_SHARED").unwrap_or_else(|_| beside.to_owned());
    println!("cargo::rustc-check-cfg=cfg(shared)");
    println!("cargo::rerun-if-env-changed=OMNIX_SHARED");
    println!("cargo::rerun-if-changed={shared}");
    println!("cargo::rustc-env=OMNIX_SHARED={shared}");
    if std::path::Path::new(&shared).is_dir() {
        println!("cargo::rustc-cfg=shared");
    }
}
