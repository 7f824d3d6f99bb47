//! The HTML viewer in headless Chromium: pages of a synthetic scene are opened from `file://` and looked at from outside,
//! through the screenshot, the page's own account of its state and the browser's console. Without Chromium these fail.

mod browser;
mod scene;

use std::{path::PathBuf, time::Instant};

use browser::{Shot, open};
use omnix_io::output::{
    html::{HtmlOptions, write_html},
    motion::MovingPoints,
};

/// A page in a folder of its own.
fn page(points: &MovingPoints, options: &HtmlOptions) -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().expect("a temporary folder can be made");
    let path = write_html(points, options, &dir.path().join("a page & more.html")).expect("the page is written");
    (dir, path)
}

fn options() -> HtmlOptions {
    HtmlOptions {
        title: "Two balls in a room".into(),
        notes: vec!["A synthetic scene; the balls' pixels are let move, the room's are not.".into()],
        ..HtmlOptions::default()
    }
}

/// Ready, and not a word on the console or in the page's own list of errors.
#[track_caller]
fn assert_clean(shot: &Shot) {
    assert_eq!(shot.console, Vec::<String>::new(), "the console stays silent");
    assert_eq!(shot.state["ready"], true, "{}", shot.state);
    assert_eq!(shot.state["errors"], serde_json::json!([]), "{}", shot.state);
}

#[test]
fn shows_points_that_change_with_time() {
    let (_dir, path) = page(&scene::moving(4000, 8), &options());
    let [first, later] = ["t=0", "t=5"].map(|fragment| open(&path, fragment, (1280, 720)));
    for (shot, time) in [(&first, 0.0), (&later, 5.0)] {
        assert_clean(shot);
        assert_eq!(shot.state["time"], time);
        // The stage, without the panels around it: the room fills much of it, in many colours.
        let (covered, colours) = shot.stage();
        assert!(covered > 0.15, "only {covered} of the stage is drawn on");
        assert!(colours > 300, "only {colours} colours on the stage");
    }
    let changed = first.difference(&later);
    // The balls, their trails and the current camera: more than the label of the time, less than the room.
    assert!((0.003..0.5).contains(&changed), "{changed} of the stage changes from time 0 to 5");
    let again = open(&path, "t=5", (1280, 720));
    assert!(later.difference(&again) < 1e-3, "the same time gives the same picture");
}

#[test]
fn plays() {
    let (_dir, path) = page(&scene::moving(1000, 8), &options());
    let shot = open(&path, "t=0&play=1", (1280, 720));
    assert_clean(&shot);
    assert_eq!(shot.state["playing"], true);
    assert!(shot.state["time"].as_f64().is_some_and(|time| time > 0.0), "time stands still: {}", shot.state);
}

#[test]
fn draws_every_colouring_and_the_view_of_a_camera() {
    let (_dir, path) = page(&scene::moving(2000, 4), &options());
    let plain = open(&path, "t=2", (1280, 720));
    for fragment in ["t=2&colour=source", "t=2&colour=motion", "t=2&colour=confidence", "t=2&view=2", "t=2&moving=1&theme=light"] {
        let shot = open(&path, fragment, (1280, 720));
        assert_clean(&shot);
        assert!(plain.difference(&shot) > 0.02, "{fragment} looks like the first view");
    }
}

#[test]
fn opens_what_has_next_to_nothing_in_it() {
    let nothing = MovingPoints { positions: vec![], ..scene::moving(0, 3) };
    for points in [nothing, scene::moving(500, 1)] {
        let (_dir, path) = page(&points, &HtmlOptions::default());
        assert_clean(&open(&path, "play=1", (420, 800)));
    }
}

#[test]
fn says_when_webgl_is_missing() {
    let (_dir, path) = page(&scene::moving(100, 2), &options());
    let shot = browser::open_with(&path, "", (1280, 720), &["--disable-3d-apis"]);
    assert!(shot.dom.contains("This page needs WebGL 2"));
    assert_eq!(shot.state["errors"], serde_json::json!([]));
}

/// Not part of the suite: the size and the speed that the viewer is made for. OMNIX_VIEWER_OUT keeps the page.
#[test]
#[ignore = "minutes on a software renderer: run it by name"]
fn two_hundred_thousand_points_at_thirty_two_times() {
    let start = Instant::now();
    let points = scene::moving(200_000, 32);
    eprintln!("{} points, scene made in {:.1} s", points.len(), start.elapsed().as_secs_f64());
    let start = Instant::now();
    let (dir, path) = page(&points, &options());
    let size = path.metadata().expect("the page is there").len();
    eprintln!("written in {:.2} s, {:.1} MB", start.elapsed().as_secs_f64(), size as f64 / 1e6);
    if let Some(out) = std::env::var_os("OMNIX_VIEWER_OUT") {
        std::fs::copy(&path, out).expect("the page can be copied to OMNIX_VIEWER_OUT");
    }
    let start = Instant::now();
    let shot = open(&path, "t=9", (1280, 720));
    eprintln!("opened, drawn and photographed in {:.1} s", start.elapsed().as_secs_f64());
    assert_clean(&shot);
    drop(dir);
}
