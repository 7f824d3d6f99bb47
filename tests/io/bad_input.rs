//! Every input a user can get wrong: a typed error that names the file and the cure.

use std::{fs, path::Path};

use omnix_io::{FrameChoice, IoError, input::load_picture, probe};

use crate::common::{pattern, save};

fn refused(path: &Path) -> IoError {
    let error = probe(&[path.to_str().unwrap()], FrameChoice::all()).unwrap_err();
    let message = error.to_string();
    assert!(message.contains(path.file_name().unwrap().to_str().unwrap()), "no path in: {message}");
    error
}

#[test]
fn missing_files_and_patterns() {
    assert!(matches!(refused(Path::new("/nowhere/clip.mp4")), IoError::NotFound { .. }));
    assert!(matches!(refused(Path::new("/nowhere/*.png")), IoError::NotFound { .. }));
    assert!(matches!(probe(&["a[.png"], FrameChoice::all()).unwrap_err(), IoError::BadPattern { .. }));
    assert!(matches!(probe::<&str>(&[], FrameChoice::all()).unwrap_err(), IoError::NoFrames { .. }));
}

#[test]
fn files_of_other_types() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["notes.txt", "scan.tiff", "plain"] {
        let path = dir.path().join(name);
        fs::write(&path, "x").unwrap();
        assert!(matches!(refused(&path), IoError::UnsupportedExtension { .. }), "{name}");
    }
}

#[test]
fn names_that_lie() {
    let dir = tempfile::tempdir().unwrap();
    let cases: [(&str, &[u8], &str); 5] = [
        ("text.png", b"this is no picture", "text"),
        ("empty.jpg", b"", "an empty file"),
        ("page.webp", b"<!DOCTYPE html><html>", "a web page"),
        ("pointer.png", b"version https://git-lfs.github.com/spec/v1", "Git LFS"),
        ("archive.bmp", b"PK\x03\x04 and more bytes", "a zip archive"),
    ];
    for (name, bytes, found) in cases {
        let path = dir.path().join(name);
        fs::write(&path, bytes).unwrap();
        let error = refused(&path);
        assert!(matches!(error, IoError::NotAnImage { .. }) && error.to_string().contains(found), "{error}");
        assert!(matches!(load_picture(&path), Err(IoError::NotAnImage { .. })));
    }
}

#[test]
fn pictures_cut_off_anywhere() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.png", "b.jpg", "c.bmp", "d.webp"] {
        let path = dir.path().join(name);
        save(&pattern(90, 60), &path);
        let whole = fs::read(&path).unwrap();
        assert!(load_picture(&path).is_ok(), "{name}");
        // A few bytes of a png's trailer may be missing without loss.
        for keep in [whole.len() - 20, whole.len() / 2, 40, 14] {
            fs::write(&path, &whole[..keep]).unwrap();
            let error = load_picture(&path).map(|_| ()).expect_err(&format!("{name} cut to {keep} of {}", whole.len()));
            assert!(matches!(error, IoError::TruncatedImage { .. }), "{name} cut to {keep}: {error:?}");
            assert!(error.to_string().contains(name), "{error}");
        }
    }
}

#[test]
fn damaged_pictures_never_panic() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.png", "b.jpg", "c.bmp", "d.webp"] {
        let path = dir.path().join(name);
        save(&pattern(48, 32), &path);
        let whole = fs::read(&path).unwrap();
        for at in (0..whole.len()).step_by(whole.len() / 60 + 1) {
            let mut bytes = whole.clone();
            bytes[at] ^= 0xa5;
            fs::write(&path, &bytes).unwrap();
            let _ = load_picture(&path);
            let _ = omnix_io::input::image_size(&path);
        }
    }
}

#[test]
fn folders_without_frames() {
    let dir = tempfile::tempdir().unwrap();
    assert!(matches!(refused(dir.path()), IoError::NoFrames { .. }));
    fs::write(dir.path().join("readme.md"), "x").unwrap();
    assert!(refused(dir.path()).to_string().contains("1 file(s) (readme.md), not a png"));
    fs::write(dir.path().join("clip.mp4"), "x").unwrap();
    assert!(refused(dir.path()).to_string().contains("as an input of its own"));
    let pattern = dir.path().join("*");
    let error = probe(&[pattern.to_str().unwrap()], FrameChoice::all()).unwrap_err();
    assert!(matches!(error, IoError::NoFrames { .. }), "{error:?}");
    assert!(error.to_string().contains("(clip.mp4)") && error.to_string().contains("quotation marks"), "{error}");
    fs::create_dir(dir.path().join("sub")).unwrap();
    assert!(matches!(refused(dir.path()), IoError::NoFrames { .. }));
}

#[cfg(unix)]
#[test]
fn a_picture_that_vanishes_after_planning() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    save(&pattern(8, 8), &path);
    let plan = probe(&[path.to_str().unwrap()], FrameChoice::all()).unwrap();
    fs::remove_file(&path).unwrap();
    let error = omnix_io::FrameLoader::new(&plan).load(0).unwrap_err();
    assert!(matches!(error, IoError::NotFound { .. }), "{error}");
}

#[cfg(unix)]
#[test]
fn pipes_and_devices_are_refused_at_once() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a.png", "a.mp4"] {
        let path = dir.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(&path).status().unwrap().success());
        assert!(matches!(refused(&path), IoError::NotAPlainFile { .. }), "{name}");
        assert!(matches!(omnix_io::input::image_size(&path), Err(IoError::NotAPlainFile { .. })), "{name}");
    }
    save(&pattern(8, 8), &dir.path().join("b.png"));
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::all()).unwrap();
    assert_eq!(plan.frames.len(), 1, "beside pictures a pipe is left aside");
    assert!(plan.notes[0].contains("a.png"), "{:?}", plan.notes);
}

#[test]
fn a_picture_that_becomes_another_after_planning() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.png");
    save(&pattern(8, 8), &path);
    let plan = probe(&[path.to_str().unwrap()], FrameChoice::all()).unwrap();
    save(&pattern(8, 7), &path);
    let error = omnix_io::FrameLoader::new(&plan).load(0).unwrap_err();
    assert!(matches!(error, IoError::Changed { .. }), "{error}");
}
