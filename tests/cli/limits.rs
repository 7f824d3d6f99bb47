//! Runs that are too large are planned, not attempted: the message names what is needed and what would fit.

use crate::common::{folder, many, of_kind, omnix, reconstruct};

#[test]
fn budget_too_small() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 2), dir.path().join("out"));
    let ran = reconstruct(&frames, &out, &["--memory-budget", "8MiB"]).fails(5, &["8 MiB", "at least"]);
    let least: u64 = ran.err.split("at least ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
    assert!(!out.exists(), "nothing is made for a run that cannot be");
    reconstruct(&frames, &out, &["--memory-budget", &format!("{}MiB", least - 1)]).fails(5, &["at least"]);
    reconstruct(&frames, &out, &["--memory-budget", &format!("{least}MiB")]).ok();
}

#[test]
fn ten_thousand_frames() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 10_000), dir.path().join("out"));
    let ran = omnix(&["plan", frames.to_str().unwrap(), "--json", "--export", "depth"]).ok();
    let events = ran.events();
    assert_eq!(of_kind(&events, "plan")[0]["images"], 10_000);
    assert!(ran.seconds < 20.0, "planning took {:.0} s", ran.seconds);
    // What moves grows with the square of the times: no device holds that of ten thousand. An export that needs all of it is refused.
    let ran = omnix(&["plan", frames.to_str().unwrap(), "--export", "html"]).fails(5, &["--frames", "would fit"]);
    assert!(ran.seconds < 20.0, "planning motion took {:.0} s", ran.seconds);
    // All of them at a size at which that is more work than anybody means without a number.
    let ran = reconstruct(&frames, &out, &["--size", "504x280"]).fails(5, &["10000", "--frames"]);
    assert!(ran.seconds < 20.0, "refusing took {:.0} s", ran.seconds);
    // Within a budget: how many would fit at once, and windows of as many where nothing needs all at once.
    let tight = |export: &str, more: &[&str]| {
        let asked = ["plan", frames.to_str().unwrap(), "--memory-budget", "200MiB", "--export", export];
        omnix(&[&asked[..], more].concat())
    };
    let ran = tight("masks", &[]).fails(5, &["--frames", "would fit"]);
    assert!(ran.seconds < 20.0, "searching took {:.0} s", ran.seconds);
    let fits = ran.err.split("; --frames ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    tight("masks", &["--frames", &fits]).ok();
    let ran = tight("depth", &["--json"]).ok();
    assert!(ran.seconds < 20.0, "searching took {:.0} s", ran.seconds);
    let events = ran.events();
    let windows = &of_kind(&events, "plan")[0]["windows"];
    assert!(windows["images"].as_u64().unwrap() >= 8 && windows["count"].as_u64().unwrap() > 10, "{windows}");
    assert!(!out.exists());
    // A few of the many run.
    reconstruct(&frames, &out, &["--frames", "2", "--export", "depth"]).ok();
}
