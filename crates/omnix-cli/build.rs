//! Says whether the process may mount file systems, as `cfg(mounts)`: the test of a full disk mounts a small one, and is ignored elsewhere
//! with that reason.

/// CAP_SYS_ADMIN of Linux, as a bit of the effective capabilities.
const MAY_MOUNT: u64 = 1 << 21;

fn main() {
    println!("cargo::rustc-check-cfg=cfg(mounts)");
    println!("cargo::rerun-if-changed=build.rs");
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let effective = status.lines().find_map(|line| line.strip_prefix("CapEff:"));
    let effective = effective.and_then(|bits| u64::from_str_radix(bits.trim(), 16).ok()).unwrap_or(0);
    if effective & MAY_MOUNT != 0 {
        println!("cargo::rustc-cfg=mounts");
    }
}
