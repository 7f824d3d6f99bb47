//! Signals in the middle of a run: exit code 130, what was finished is readable, and no half file is left.

use std::io::{BufRead as _, BufReader};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use serde_json::Value;

use crate::common::{finite, json, many, program, reconstruct, video};

/// A run that was sent a signal when its third image was finished: exit code, last event, standard error.
fn signalled(command: &mut Command, signal: &str) -> (Option<i32>, Value, String) {
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let third =
        lines.by_ref().map(Result::unwrap).find(|l| l.contains("\"event\":\"frame\"") && l.contains("\"index\":2"));
    assert!(third.is_some(), "no third image");
    let sent = Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let output = child.wait_with_output().unwrap();
    let last = serde_json::from_str(rest.last().unwrap()).unwrap();
    (output.status.code(), last, String::from_utf8_lossy(&output.stderr).into_owned())
}

/// Names of files in the making, in the folder and below it.
fn unfinished(dir: &Path) -> Vec<PathBuf> {
    let Ok(entries) = std::fs::read_dir(dir) else { return Vec::new() };
    let paths = entries.map(|e| e.unwrap().path());
    paths
        .flat_map(|path| {
            if path.is_dir() {
                return unfinished(&path);
            }
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            if name.starts_with(".omnix-") { vec![path] } else { Vec::new() }
        })
        .collect()
}

#[test]
fn what_was_finished_is_readable() {
    for (signal, name) in [("-INT", "INT"), ("-TERM", "TERM"), ("-HUP", "HUP")] {
        let dir = tempfile::tempdir().unwrap();
        let (frames, out) = (many(dir.path(), 60), dir.path().join("out"));
        // Whoever runs the tests may have told them to ignore it, as nohup does.
        let mut command = Command::new("env");
        command.arg(format!("--default-signal={name}")).arg(program().get_program());
        command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--json", "--export", "npz,depth,ply"]);
        let (code, last, said) = signalled(&mut command, signal);
        assert_eq!(code, Some(130), "{signal}: {said}");
        assert_eq!((last["event"].as_str(), last["kind"].as_str()), (Some("error"), Some("interrupted")));

        let manifest = json(&out.join("manifest.json"));
        assert_eq!(manifest["interrupted"], true);
        let done = manifest["images"].as_array().unwrap().iter().filter(|f| f["done"] == true).count() as u64;
        assert!((3..60).contains(&done), "{done} images were finished");
        let [height, width] = [84, 140];
        finite(&out.join("exports/npz/results.npz"), "depth", &[done, height, width]);
        for i in 0..done {
            image::open(out.join(format!("depth/{i:06}.png"))).unwrap();
        }
        assert_eq!(unfinished(&out), Vec::<PathBuf>::new());
    }
}

#[test]
fn a_second_signal_ends_at_once_and_leaves_no_half_file() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 12), dir.path().join("out"));
    let mut command = program();
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--json", "--export", "field,html,tracks"]);
    command.arg("--all-tracks");
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn().unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    assert!(lines.map(Result::unwrap).any(|l| l.contains("\"phase\":\"sampling\"")), "no sampling");
    // A file is being written when there is one in the making.
    while unfinished(&out).is_empty() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(std::time::Duration::from_millis(2));
    }
    for _ in 0..2 {
        let _ = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    assert_eq!(child.wait().unwrap().code(), Some(130));
    assert_eq!(unfinished(&out), Vec::<PathBuf>::new());
}

#[test]
fn a_run_under_nohup_outlives_its_terminal() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 12), dir.path().join("out"));
    // What nohup does: the signal is ignored from the start.
    let mut command = Command::new("sh");
    command.args(["-c", "trap '' HUP; exec \"$@\"", "sh"]).arg(program().get_program());
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--json", "--export", "depth"]);
    let (code, last, said) = signalled(&mut command, "-HUP");
    assert_eq!((code, last["event"].as_str()), (Some(0), Some("done")), "{said}");
    assert_eq!(json(&out.join("manifest.json"))["interrupted"], false);
}

#[test]
fn a_killed_run_leaves_nothing_that_the_next_does_not_remove() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 3), dir.path().join("out"));
    let left = [out.join(".omnix-a1b2c3.part"), out.join("exports/npz/.omnix-d4e5f6.part")];
    for path in &left {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, "half").unwrap();
    }
    reconstruct(&frames, &out, &["--export", "depth"]).ok();
    assert_eq!(unfinished(&out), Vec::<PathBuf>::new());
}

/// `command` in a shell that limits files to this many blocks of 1024 bytes.
fn limited(blocks: u32, script: &str) -> Command {
    let mut command = Command::new("bash");
    command.args(["-c", &format!("ulimit -c 0; ulimit -f {blocks}; {script}"), "bash"]).arg(program().get_program());
    command.stdin(Stdio::null());
    command
}

#[test]
fn a_limit_of_file_sizes_is_an_error() {
    let dir = tempfile::tempdir().unwrap();
    // A write beyond it fails and does not end the process.
    let script = format!("\"$@\" > {}/events", dir.path().display());
    let mut command = limited(0, &script);
    command.args(["plan", "--images", "1", "--size", "14x14", "--json"]);
    crate::common::finish(&mut command).fails(6, &["standard output"]);
    // The memory of a software device is a file too, and would end the process when it cannot grow.
    let (frames, out) = (many(dir.path(), 6), dir.path().join("out"));
    let mut command = limited(20_000, "exec \"$@\"");
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--export", "field", "--size", "252x168"]);
    crate::common::finish(&mut command).fails(6, &["ulimit -f", "20 MiB"]);
    assert!(!out.exists());
}

/// A program that begins to run and says nothing more, in the place of ffmpeg.
#[cfg(unix)]
fn silent_ffmpeg(dir: &std::path::Path) -> std::path::PathBuf {
    let fake = dir.join("silent-ffmpeg");
    let script = "#!/bin/sh\n[ \"$1\" = -version ] && { echo ffmpeg version 6.0; exit 0; }\n\
                  echo $$ > \"$OMNIX_TEST_PID\"\nexec sleep 60\n";
    std::fs::write(&fake, script).unwrap();
    assert!(Command::new("chmod").arg("+x").arg(&fake).status().unwrap().success());
    fake
}

#[cfg(unix)]
#[test]
fn a_video_that_is_being_read_is_left_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let (clip, out, pid) = (dir.path().join("clip.mp4"), dir.path().join("out"), dir.path().join("pid"));
    video(&clip);
    let mut command = program();
    command.arg("reconstruct").arg(&clip).arg("--out").arg(&out);
    command.env("OMNIX_FFMPEG", silent_ffmpeg(dir.path())).env("OMNIX_TEST_PID", &pid);
    let child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let since = std::time::Instant::now();
    let theirs = loop {
        assert!(since.elapsed().as_secs() < 30, "ffmpeg was not started");
        match std::fs::read_to_string(&pid) {
            Ok(text) if text.ends_with('\n') => break text.trim().to_owned(),
            _ => std::thread::sleep(std::time::Duration::from_millis(20)),
        }
    };
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(since.elapsed().as_secs() < 40, "it waited for ffmpeg");
    assert!(!Command::new("kill").args(["-0", &theirs]).output().unwrap().status.success(), "ffmpeg lives on");
    assert!(!out.exists(), "nothing was begun");
}
