//! What surrounds a run: folders that others use too, outputs that are closed or full, names in any bytes, few threads.

use std::fs;
use std::process::{Command, Stdio};

use omnix::io::output::OutputFolder;

use crate::common::{finish, folder, json, many, of_kind, omnix, picture, program, reconstruct};

#[test]
fn results_do_not_go_among_the_inputs() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 2);
    let first = reconstruct(&frames, &frames, &["--export", "depth"]).ok();
    assert!(first.err.contains("results go into the folder of the inputs"), "{}", first.err);
    for out in [frames.clone(), dir.path().join("elsewhere")] {
        reconstruct(&frames, &out, &["--export", "depth"]).fails(2, &["result", "--out"]);
    }
    assert_eq!(json(&frames.join("manifest.json"))["images"].as_array().unwrap().len(), 2, "the first run's");
    // A result of a run, read into its own place.
    let (photo, out) = (dir.path().join("photo.png"), dir.path().join("out"));
    picture(&photo, 150, 90, 0);
    reconstruct(&photo, &out, &["--export", "depth"]).ok();
    let result = out.join("depth_color/000000.png");
    let before = fs::read(&result).unwrap();
    reconstruct(&result, &out, &["--export", "depth"]).fails(2, &["name of a result", "depth_color"]);
    assert_eq!(before, fs::read(&result).unwrap());
}

#[test]
fn one_run_at_a_time_writes_to_a_folder() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 1), dir.path().join("out"));
    let held = OutputFolder::open(&out).unwrap();
    reconstruct(&frames, &out, &["--export", "depth"]).fails(6, &["another run", "out"]);
    assert_eq!(fs::read_dir(&out).unwrap().count(), 0);
    drop(held);
    reconstruct(&frames, &out, &["--export", "depth"]).ok();
}

#[test]
fn a_folder_that_goes_away_is_no_success() {
    use std::io::{BufRead as _, BufReader};

    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 8), dir.path().join("out"));
    let mut command = program();
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--json", "--export", "depth"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.by_ref().map(Result::unwrap).any(|l| l.contains("\"index\":2")), "no third image");
    // The program may write another file while this removes the folder.
    while fs::remove_dir_all(&out).is_err_and(|e| e.kind() == std::io::ErrorKind::DirectoryNotEmpty) {}
    assert!(lines.last().unwrap().unwrap().contains("\"error\""));
    let output = child.wait_with_output().unwrap();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(6), "{said}");
    // Named is the file being written at that moment, or the first one of those written before.
    assert!(said.contains("something removed it or its folder") && said.contains("depth/0000"), "{said}");
}

#[test]
fn files_of_an_earlier_run_are_named() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 3), dir.path().join("out"));
    let first = reconstruct(&frames, &out, &["--export", "depth,ply"]).ok();
    assert!(!first.err.contains("earlier run"), "{}", first.err);
    let second = reconstruct(&frames, &out, &["--export", "depth", "--frames", "2"]).ok();
    let words = "3 files of an earlier run are still in the output folder: depth/000002.png to points.ply";
    assert!(second.err.contains(words), "{}", second.err);
    let notes = json(&out.join("manifest.json"))["notes"].to_string();
    assert!(notes.contains(words), "{notes}");
}

#[cfg(unix)]
#[test]
fn names_in_any_bytes() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt as _;

    let dir = tempfile::tempdir().unwrap();
    let frames = dir.path().join("frames");
    picture(&dir.path().join("x.png"), 150, 90, 0);
    fs::create_dir(&frames).unwrap();
    fs::rename(dir.path().join("x.png"), frames.join(OsStr::from_bytes(b"caf\xe9.png"))).unwrap();
    let out = dir.path().join(OsStr::from_bytes(b"out\xe9"));
    let ran = reconstruct(&frames, &out, &["--export", "npz", "--json"]).ok();
    let last = ran.events().pop().unwrap();
    assert!(last["dir"].as_str().unwrap().ends_with("out\u{fffd}"), "{last}");
    let manifest = json(&out.join("manifest.json"));
    // On the command line too.
    let named = frames.join(OsStr::from_bytes(b"caf\xe9.png"));
    reconstruct(&named, &dir.path().join("again"), &["--export", "npz"]).ok();
    assert!(manifest["images"][0]["source"].as_str().unwrap().ends_with("caf\u{fffd}.png"), "{manifest}");
}

#[cfg(unix)]
#[test]
fn names_that_a_terminal_would_obey() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("\u{1b}]0;title\u{7}.png");
    fs::write(&file, "this is text").unwrap();
    let ran =
        reconstruct(&file, &dir.path().join("out"), &[]).fails(3, &["not a picture", "\\u{1b}]0;title\\u{7}.png"]);
    assert!(!ran.err.contains(['\u{1b}', '\u{7}']), "{:?}", ran.err);
}

#[cfg(target_os = "linux")]
#[test]
fn messages_that_cannot_be_written_are_no_failure() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 1), dir.path().join("out"));
    let full = || fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let mut run = program();
    run.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--export", "depth"]);
    assert_eq!(run.stderr(full()).status().unwrap().code(), Some(0));
    assert!(out.join("manifest.json").exists());
    let code = |command: &mut Command| command.stderr(full()).status().unwrap().code();
    assert_eq!(code(program().args(["plan", "/nonexistent"])), Some(3));
    assert_eq!(code(program().args(["plan", "--no-such-option"])), Some(2));
    // Events that are lost are one: they are what machines asked for.
    let mut run = program();
    run.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--export", "depth", "--json"]);
    assert_eq!(run.stdout(full()).stderr(Stdio::null()).status().unwrap().code(), Some(6));
    assert_eq!(json(&out.join("manifest.json"))["interrupted"], false, "the files are whole all the same");
}

#[cfg(target_os = "linux")]
#[test]
fn a_machine_that_gives_no_threads() {
    let dir = tempfile::tempdir().unwrap();
    let frames = folder(dir.path(), 2);
    // A limit of processes does not hold for root: as a user who has none yet, from a copy that any user can reach.
    let copy = dir.path().join("omnix");
    fs::copy(program().get_program(), &copy).unwrap();
    let script = "d=$1; shift; chmod -R a+rX \"$d\"; u='ulimit -u 1; exec \"$@\"'
        if [ \"$(id -u)\" = 0 ]; then exec setpriv --reuid=65531 --regid=65531 --clear-groups bash -c \"$u\" bash \"$@\"
        else exec bash -c \"$u\" bash \"$@\"; fi";
    let mut command = Command::new("bash");
    command.args(["-c", script, "bash"]).args([dir.path(), &copy]).arg("plan").arg(&frames).arg("--json");
    let ran = finish(command.stdin(Stdio::null())).ok();
    assert_eq!(of_kind(&ran.events(), "plan")[0]["images"], 2);
}

#[test]
fn quiet_and_verbose() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (folder(dir.path(), 1), dir.path().join("out"));
    let out = out.to_str().unwrap();
    let run = |more: &str| omnix(&["reconstruct", frames.to_str().unwrap(), "-o", out, "--export", "depth", more]).ok();
    assert_eq!(run("-q").err, "");
    let (usual, more) =
        (omnix(&["reconstruct", frames.to_str().unwrap(), "-o", out, "--export", "depth"]).ok().err, run("-v").err);
    assert!(!usual.contains("tokens") && more.contains("tokens"), "{more}");
}
