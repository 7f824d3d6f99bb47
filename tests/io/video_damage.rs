//! Damaged and cut-off videos: what can be decoded is used, how much is lost is said, and strict readers refuse.

use std::{fs, path::Path, process::Command};

use omnix_io::{FrameChoice, FrameLoader, IoError, ReadOptions, input::probe_video, probe, probe_with};

use crate::{
    common::data,
    video::{clip, plan},
};

/// What a strict reader says.
fn refused(path: &Path) -> String {
    let error = probe_with(&[path], &ReadOptions::default().strict(true)).unwrap_err();
    assert!(matches!(error, IoError::DamagedVideo { .. }), "{path:?}: {error:?}");
    error.to_string()
}

/// How many frames are planned, all of which can be read, and the one note.
fn used(path: &Path) -> (usize, String) {
    let plan = plan(path, FrameChoice::all());
    let mut loader = FrameLoader::new(&plan);
    for index in 0..plan.frames.len() {
        loader.load(index).unwrap_or_else(|e| panic!("{path:?}: {e}"));
    }
    assert_eq!(plan.notes.len(), 1, "{path:?}: {:?}", plan.notes);
    (plan.frames.len(), plan.notes[0].clone())
}

#[test]
fn cut_off_videos_of_every_container() {
    let dir = tempfile::tempdir().unwrap();
    let cases = [
        ("a.mp4", &["-movflags", "+faststart"][..]),
        ("a.mkv", &[]),
        ("a.webm", &["-c:v", "libvpx", "-b:v", "1M"]),
        ("a.avi", &[]),
        ("a.flv", &["-c:v", "flv"]),
        // Its packets are filled up to 3200 bytes: frames have to be large to be in several.
        ("a.wmv", &["-c:v", "wmv2", "-vf", "noise=alls=60:allf=t"]),
    ];
    for (name, extra) in cases {
        let mut extra = extra.to_vec();
        extra.extend(["-g", "1"]);
        let path = clip(dir.path(), name, 20, &extra);
        assert!(plan(&path, FrameChoice::all()).notes.is_empty(), "{name} is whole");
        assert!(probe_with(&[&path], &ReadOptions::default().strict(true)).is_ok(), "{name} is whole");
        let whole = fs::read(&path).unwrap();
        // Headers take up much of so small a file.
        fs::write(&path, &whole[..whole.len() * 4 / 5]).unwrap();
        let (frames, note) = used(&path);
        assert!((1..20).contains(&frames), "{name}: {frames} frames");
        assert!(note.contains("cut off") && note.contains(&format!("of {} bytes", whole.len())), "{name}: {note}");
        // Of a wmv that is cut off ffmpeg does not say how long it was.
        let of = if name == "a.wmv" { "" } else { " of about 20" };
        assert!(note.contains(&format!("{frames}{of} frames")), "{name}: {note}");
        assert!(refused(&path).contains("cut off"), "{name}");
    }
}

#[test]
fn an_index_that_is_cut_off_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    // The index of an mp4 is at its end unless it is told otherwise.
    let path = clip(dir.path(), "a.mp4", 20, &[]);
    let whole = fs::read(&path).unwrap();
    fs::write(&path, &whole[..whole.len() * 4 / 5]).unwrap();
    let error = probe(&[path.to_str().unwrap()], FrameChoice::all()).unwrap_err();
    assert!(matches!(error, IoError::TruncatedVideo { .. }), "{error:?}");
    assert!(error.to_string().contains("cut off"), "{error}");
}

#[test]
fn damage_in_the_middle_is_counted() {
    let (frames, note) = used(&data("damaged.mkv"));
    assert_eq!(frames, 3);
    assert!(note.contains("damaged: 3 of about 20 frames could be decoded"), "{note}");
    assert!(refused(&data("damaged.mkv")).contains("3 of about 20"));
}

/// Place and length of the data of frame `number`.
fn packet(path: &Path, number: usize) -> (usize, usize) {
    let output = Command::new("ffprobe")
        .args(["-v", "error", "-select_streams", "v:0", "-of", "csv=p=0", "-show_entries", "packet=size,pos"])
        .arg(path)
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let (size, at) = text.lines().nth(number).unwrap().split_once(',').unwrap();
    (at.trim_end_matches(',').parse().unwrap(), size.parse().unwrap())
}

#[test]
fn one_bad_frame_costs_no_others() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.mp4", "a.mkv", "a.avi"] {
        let path = clip(dir.path(), name, 20, &["-q:v", "1", "-g", "4"]);
        let mut bytes = fs::read(&path).unwrap();
        let (at, size) = packet(&path, 9);
        bytes[at + size / 2..at + size - 4].fill(0x55);
        fs::write(&path, &bytes).unwrap();
        let (frames, note) = used(&path);
        assert!((19..=20).contains(&frames), "{name}: {frames} frames; {note}");
        assert!(note.contains("damaged"), "{name}: {note}");
        assert!(refused(&path).contains("damaged"), "{name}");
        let damage = probe_video(&path, &ReadOptions::default()).unwrap().damage.unwrap();
        assert!(damage.patched > 0 || damage.words.is_some(), "{name}: {damage:?}");
    }
}

#[test]
fn much_damage_is_an_error_or_pictures_but_no_hang() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.mp4", "a.mkv", "a.avi", "a.flv", "a.wmv"] {
        let codec = match &name[2..] {
            "flv" => "flv",
            "wmv" => "wmv2",
            _ => "mpeg4",
        };
        let path = clip(dir.path(), name, 12, &["-g", "3", "-c:v", codec]);
        let whole = fs::read(&path).unwrap();
        for part in 0..4 {
            let mut bytes = whole.clone();
            let from = whole.len() * part / 4;
            let to = (from + 400).min(whole.len());
            bytes[from..to].iter_mut().for_each(|b| *b ^= 0xa5);
            fs::write(&path, &bytes).unwrap();
            if let Ok(plan) = probe(&[path.to_str().unwrap()], FrameChoice::all()) {
                let mut loader = FrameLoader::new(&plan);
                for frame in &plan.frames {
                    let picture = loader.load(frame.index).unwrap_or_else(|e| panic!("{name}, part {part}: {e}"));
                    assert_eq!((picture.width, picture.height), (frame.width, frame.height), "{name}, part {part}");
                }
            }
        }
    }
}
