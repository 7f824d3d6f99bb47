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
    // What moves grows with the square of the times: no device holds that of ten thousand.
    let ran = omnix(&["plan", frames.to_str().unwrap()]).fails(5, &["--frames", "would fit"]);
    assert!(ran.seconds < 20.0, "planning motion took {:.0} s", ran.seconds);
    // All of them: more work than anybody means without a number.
    let ran = reconstruct(&frames, &out, &[]).fails(5, &["10000", "--frames"]);
    assert!(ran.seconds < 20.0, "refusing took {:.0} s", ran.seconds);
    // Within a budget: how many would fit.
    let tight = ["--export", "depth", "--memory-budget", "200MiB"];
    let ran = reconstruct(&frames, &out, &tight).fails(5, &["at least", "--frames", "would fit"]);
    assert!(ran.seconds < 20.0, "searching took {:.0} s", ran.seconds);
    let fits = ran.err.split("; --frames ").nth(1).unwrap().split(' ').next().unwrap().to_owned();
    omnix(&["plan", frames.to_str().unwrap(), "--frames", &fits, "--export", "depth", "--memory-budget", "200MiB"])
        .ok();
    assert!(!out.exists());
    // A few of the many run.
    reconstruct(&frames, &out, &["--frames", "2", "--export", "depth"]).ok();
}
