//! Ctrl-C in the middle: exit code 130, and what was finished is readable.

use std::io::{BufRead as _, BufReader};
use std::process::{Command, Stdio};

use crate::common::{finite, json, many, program};

#[cfg(unix)]
#[test]
fn what_was_finished_is_readable() {
    let dir = tempfile::tempdir().unwrap();
    let (frames, out) = (many(dir.path(), 60), dir.path().join("out"));
    let mut command = program();
    command.arg("reconstruct").arg(&frames).arg("--out").arg(&out).args(["--json", "--export", "npz,depth,ply"]);
    let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let third =
        lines.by_ref().map(Result::unwrap).find(|l| l.contains("\"event\":\"frame\"") && l.contains("\"index\":2"));
    assert!(third.is_some(), "no third image");
    let sent = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(sent.success());
    let rest: Vec<String> = lines.map(Result::unwrap).collect();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(130), "{}", String::from_utf8_lossy(&output.stderr));
    let last: serde_json::Value = serde_json::from_str(rest.last().unwrap()).unwrap();
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
}
