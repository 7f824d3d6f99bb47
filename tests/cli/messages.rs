//! Messages say what was asked and what would do, in the program's own words; machines get the same as JSON.

use crate::common::{folder, of_kind, omnix, reconstruct};

#[test]
fn usage_errors_reach_machines() {
    for args in [
        &["reconstruct", "--json"][..],
        &["reconstruct", "x.png", "--out", "o", "--json", "--frames", "x"],
        &["plan", "--json"],
        &["query", "f", "--json", "--image", "0"],
        &["no-such-command", "--json"],
    ] {
        let ran = omnix(args).fails(2, &[]);
        let event = ran.events().pop().unwrap_or_default();
        let words = (event["event"].as_str(), event["kind"].as_str(), event["exit_code"].as_u64());
        assert_eq!(words, (Some("error"), Some("usage"), Some(2)), "{args:?}: {}", ran.out);
        assert!(!event["message"].as_str().unwrap().contains('\n'), "{event}");
    }
    // After `--` it is a name.
    assert_eq!(omnix(&["plan", "--frames", "x", "--", "--json"]).fails(2, &[]).out, "");
}

#[test]
fn numbers_below_zero_are_values() {
    for option in
        ["--frames", "--fps", "--points", "--memory-budget", "--process-res", "--conf-percentile", "--reference"]
    {
        let ran = omnix(&["reconstruct", "x.png", "--out", "o", option, "-1"]);
        assert!(!ran.err.contains("-- -1"), "{option}: {}", ran.err);
        assert!(ran.err.contains("-1") || ran.err.contains("rate"), "{option}: {}", ran.err);
    }
}

#[test]
fn more_images_than_any_run_has() {
    for images in ["4000000000", "99999999999999999999", "0", "-1", "1048577"] {
        let ran = omnix(&["plan", "--images", images, "--size", "14x14"]).fails(2, &["--images"]);
        assert!(ran.seconds < 5.0, "{images}: {} s", ran.seconds);
    }
    // The most that is taken: refused by its size, before anything is sized by it.
    let ran = omnix(&["plan", "--images", "1048576", "--size", "14x14"]);
    assert!(matches!(ran.code, Some(0 | 5)), "{}", ran.err);
}

#[test]
fn options_are_called_by_their_names() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 6), dir.path().join("out"));
    let run = |more: &[&str]| reconstruct(&frames, &out, more);
    let ran = run(&["--process-res-method", "upper_bound_crop"]).fails(2, &["--process-res-method is for Depth"]);
    assert!(!ran.err.contains("--process-res is"), "{}", ran.err);
    run(&["--process-res", "70"]).fails(2, &["--process-res is for Depth"]);
    run(&["--reference", "5"]).fails(2, &["image 5 as the reference view", "takes the first image"]);
    run(&["--reference", "middle"]).fails(2, &["the middle image as the reference view"]);
    run(&["--device", "voodoo"]).fails(4, &["no device has the index or a name with `voodoo`", "0: ", "--device"]);
    // Names inside of a graph say nothing to a user.
    let huge = omnix(&["plan", "--images", "20000", "--size", "504x280", "--export", "html"]).fails(5, &["--frames"]);
    assert!(!huge.err.contains('#') && !huge.err.contains('`'), "{}", huge.err);
    assert!(!out.exists());
}

#[test]
fn sizes_are_width_then_height_in_every_event() {
    let events = omnix(&["plan", "--images", "2", "--size", "140x84", "--json"]).ok().events();
    let size = &of_kind(&events, "plan")[0]["image_size"];
    assert_eq!(*size, serde_json::json!([140, 84]));
}

#[test]
fn shells_are_told_of_every_command() {
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        let script = omnix(&["completions", shell]).ok().out;
        for word in ["omnix", "reconstruct", "export", "completions"] {
            assert!(script.contains(word), "{shell}: {word}");
        }
    }
    omnix(&["completions", "cmd"]).fails(2, &["bash"]);
}
