//! The other commands: help, plan, devices, weights, bench.

use crate::common::{json, of_kind, omnix};

#[test]
fn help_documents_exit_codes() {
    for args in [&["--help"][..], &["reconstruct", "--help"]] {
        let help = omnix(args).ok().out;
        for code in ["130", "interrupted", "disk is full", "--"] {
            assert!(help.contains(code), "{args:?}: {code}");
        }
    }
    assert_eq!(omnix(&["--version"]).ok().out.split(' ').next(), Some("omnix"));
    assert_eq!(omnix(&[]).code, Some(2));
}

#[test]
fn a_plan_without_files_or_device() {
    let run = |more: &[&str]| {
        let mut command = crate::common::program();
        command.args(["plan", "--images", "64", "--size", "140x84", "--json", "--export", "depth"]).args(more);
        // No driver: plans need none.
        command.env("VK_DRIVER_FILES", "/nonexistent.json").env("VK_ICD_FILENAMES", "/nonexistent.json");
        crate::common::finish(&mut command)
    };
    let plan = |more: &[&str]| of_kind(&run(more).ok().events(), "plan")[0].clone();
    let free = plan(&[]);
    assert_eq!((free["images"].as_u64(), free["tokens"].as_u64()), (Some(64), Some(64 * 61)));
    assert!(free["stages"][0]["flops"].as_u64().unwrap() > 1_000_000_000);
    let peak = free["peak_bytes"].as_u64().unwrap();
    let tight = plan(&["--memory-budget", &format!("{}MiB", (peak >> 20) - 1)]);
    assert!(tight["peak_bytes"].as_u64().unwrap() <= ((peak >> 20) - 1) << 20, "a budget is kept");
    let parts = |plan: &serde_json::Value| -> u64 {
        plan["stages"].as_array().unwrap().iter().map(|stage| stage["parts"].as_u64().unwrap()).sum()
    };
    assert!(parts(&tight) > parts(&free), "smaller chunks");
    for class in ["baseline", "gpu"] {
        assert_eq!(plan(&["--device-class", class])["images"], 64);
    }
    run(&["--memory-budget", "1MiB"]).fails(5, &["at least"]);
}

#[test]
fn devices_are_listed_with_what_they_lack() {
    let listed = omnix(&["devices"]).ok().out;
    assert!(listed.contains("0: ") && listed.contains("(default)") && listed.contains("TIMESTAMP_QUERY"), "{listed}");
    let events = omnix(&["devices", "--json"]).ok().events();
    let devices = events[0]["devices"].as_array().unwrap();
    assert!(devices.iter().any(|d| d["usable"] == true && d["tier"].is_string()), "{devices:?}");
    // Where the default is a software device, both forms say so and why.
    let default = &devices[events[0]["default"].as_u64().unwrap() as usize];
    let why = events[0]["software"].as_str();
    assert_eq!(why.is_some(), default["kind"] == "Cpu", "{events:?}");
    assert!(why.is_none_or(|why| listed.contains(&format!("a software device: {why}"))), "{listed}");
}

#[test]
fn the_embedded_checkpoint() {
    let info = omnix(&["weights", "info", "nano"]).ok().out;
    assert!(info.contains("6.71 M") && info.contains("blake3:") && info.contains("very small network"), "{info}");
    let checked = omnix(&["weights", "check", "nano", "--json"]).ok().events();
    assert_eq!((checked[0]["ok"].as_bool(), checked[0]["problems"].as_u64()), (Some(true), Some(0)));
}

#[test]
fn a_quick_bench_with_its_trace() {
    let dir = tempfile::tempdir().unwrap();
    let trace = dir.path().join("trace.json");
    let events = omnix(&["bench", "--quick", "--json", "--trace", trace.to_str().unwrap()]).ok().events();
    let rows = of_kind(&events, "row");
    for name in ["linear", "attention", "layer_norm", "da3-small"] {
        let row = rows.iter().find(|r| r["name"] == name).unwrap_or_else(|| panic!("no {name}"));
        assert!(row["seconds"].as_f64().unwrap() > 0.0 && row["rate"].as_f64().unwrap() > 0.0, "{row}");
    }
    assert!(json(&trace)["traceEvents"].as_array().unwrap().len() > 50);
}
