//! Videos through ffmpeg: times, rotation, choice of frames, cut-off files, a missing program.

use std::{
    fs,
    path::{Path, PathBuf},
    process::Command,
};

use omnix_io::{FrameChoice, FrameLoader, InputPlan, IoError, Picture, ReadOptions, input::probe_video, probe};

use crate::common::{save, shared};

/// A picture whose mean grey tells its number.
pub(crate) fn numbered(width: u32, height: u32, number: u8) -> Picture {
    let mut data = vec![20 + 8 * number; (width * height * 3) as usize];
    // The top left quarter is bright, so that a turn shows.
    for y in 0..height as usize / 2 {
        for x in 0..width as usize / 2 {
            data[(y * width as usize + x) * 3..][..3].fill(250);
        }
    }
    Picture::new(width, height, data)
}

pub(crate) fn number_of(picture: &Picture) -> u8 {
    let (x, y) = (picture.width as usize - 5, picture.height as usize - 5);
    let value = picture.data[(y * picture.width as usize + x) * 3];
    ((f32::from(value) - 20.0) / 8.0).round() as u8
}

pub(crate) fn ffmpeg(arguments: &[&str]) {
    let output = Command::new("ffmpeg").args(["-nostdin", "-v", "error", "-y"]).args(arguments).output();
    let output = output.expect("ffmpeg is part of the test machine's set-up");
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
}

/// A clip of `count` numbered pictures, 64 x 48, at 10 frames a second.
pub(crate) fn clip(dir: &Path, name: &str, count: u8, extra: &[&str]) -> PathBuf {
    let _ = fs::remove_dir_all(dir.join("in"));
    for n in 0..count {
        save(&numbered(64, 48, n), &dir.join(format!("in/{n:03}.png")));
    }
    let (input, out) = (dir.join("in/%03d.png"), dir.join(name));
    let mut arguments = vec!["-framerate", "10", "-i", input.to_str().unwrap(), "-c:v", "mpeg4", "-q:v", "2"];
    arguments.extend(extra);
    arguments.push(out.to_str().unwrap());
    ffmpeg(&arguments);
    out
}

pub(crate) fn plan(path: &Path, choice: FrameChoice) -> InputPlan {
    probe(&[path.to_str().unwrap()], choice).unwrap()
}

pub(crate) fn numbers(plan: &InputPlan) -> Vec<u8> {
    let mut loader = FrameLoader::new(plan);
    (0..plan.frames.len()).map(|i| number_of(&loader.load(i).unwrap())).collect()
}

#[test]
fn every_frame_with_its_time() {
    let dir = tempfile::tempdir().unwrap();
    for (name, extra) in [("a.mp4", &[][..]), ("b.mkv", &["-bf", "2"]), ("c.avi", &[]), ("d.MOV", &["-bf", "2"])] {
        let path = clip(dir.path(), name, 20, extra);
        let plan = plan(&path, FrameChoice::all());
        let times: Vec<f64> = plan.frames.iter().map(|f| f.time_s.unwrap()).collect();
        assert_eq!(times.len(), 20, "{name}");
        let start = times[0];
        assert!(times.iter().enumerate().all(|(i, t)| (t - start - i as f64 / 10.0).abs() < 2e-3), "{name}: {times:?}");
        assert!(plan.frames.iter().all(|f| (f.width, f.height) == (64, 48)));
        assert_eq!(numbers(&plan), (0..20).collect::<Vec<_>>(), "{name}");
    }
}

#[test]
fn chosen_frames_and_going_back() {
    let dir = tempfile::tempdir().unwrap();
    let path = clip(dir.path(), "a.mp4", 20, &["-bf", "2"]);
    assert_eq!(numbers(&plan(&path, FrameChoice::count(3))), [0, 10, 19]);
    assert_eq!(numbers(&plan(&path, FrameChoice::fps(2.5))), [0, 4, 8, 12, 16]);
    let part = FrameChoice::all().between(Some(0.5), Some(1.2));
    assert_eq!(numbers(&plan(&path, part.every(3))), [5, 8, 11]);
    assert_eq!(numbers(&plan(&path, part.at_rate(5.0).at_most(2))), [5, 11]);
    let late = probe(&[path.to_str().unwrap()], FrameChoice::all().between(Some(9.0), None)).unwrap_err();
    assert!(matches!(&late, IoError::BadChoice { .. }) && late.to_string().contains("1.90 seconds"), "{late}");
    let plan = plan(&path, FrameChoice::count(5));
    let numbers: Vec<u32> = plan.frames.iter().map(|f| f.source_frame).collect();
    let mut loader = FrameLoader::new(&plan);
    for index in [3, 4, 0, 2, 2, 1] {
        assert_eq!(u32::from(number_of(&loader.load(index).unwrap())), numbers[index], "frame {index}");
    }
}

#[test]
fn more_chosen_frames_than_ffmpeg_selects_itself() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("long.mkv");
    ffmpeg(&[
        "-f",
        "lavfi",
        "-i",
        "testsrc2=s=64x48:r=100:d=3.2,noise=alls=40:allf=t",
        "-c:v",
        "ffv1",
        path.to_str().unwrap(),
    ]);
    let (all, some) = (plan(&path, FrameChoice::all()), plan(&path, FrameChoice::count(300)));
    assert_eq!((all.frames.len(), some.frames.len()), (320, 300));
    let pictures: Vec<Picture> = {
        let mut loader = FrameLoader::new(&all);
        (0..320).map(|i| loader.load(i).unwrap()).collect()
    };
    assert!(pictures.windows(2).all(|w| w[0] != w[1]), "every frame differs from the next");
    let mut loader = FrameLoader::new(&some);
    for frame in &some.frames {
        let picture = loader.load(frame.index).unwrap();
        assert!(picture == pictures[frame.source_frame as usize], "frame {}", frame.source_frame);
    }
}

#[test]
fn two_videos_and_a_photo() {
    let dir = tempfile::tempdir().unwrap();
    let first = clip(dir.path(), "a.mp4", 6, &[]);
    let second = clip(dir.path(), "b: c's %02d.mkv", 4, &[]);
    let photo = dir.path().join("in/003.png");
    let inputs: Vec<&str> = [&first, &photo, &second].map(|p| p.to_str().unwrap()).to_vec();
    let plan = probe(&inputs, FrameChoice::count(2)).unwrap();
    let table: Vec<_> = plan.frames.iter().map(|f| (f.video, f.frame, f.source_frame)).collect();
    assert_eq!(table, [(0, 0, 0), (0, 1, 5), (1, 0, 0), (2, 0, 0), (2, 1, 3)], "each input is a video");
    assert_eq!(numbers(&plan), [0, 5, 3, 0, 3]);
}

#[test]
fn rotation_is_applied() {
    let dir = tempfile::tempdir().unwrap();
    let plain = clip(dir.path(), "plain.mp4", 3, &[]);
    let turned = dir.path().join("turned.mp4");
    let (from, to) = (plain.to_str().unwrap(), turned.to_str().unwrap());
    // Up to ffmpeg 5 the tag sets the display matrix, with a sign that changed over the versions; later ones have an option.
    ffmpeg(&["-i", from, "-c", "copy", "-metadata:s:v", "rotate=90", to]);
    if probe_video(&turned, &ReadOptions::default()).unwrap().rotation == 0 {
        ffmpeg(&["-display_rotation", "-90", "-i", from, "-c", "copy", to]);
    }
    let plan = plan(&turned, FrameChoice::all());
    let rotation = probe_video(&turned, &ReadOptions::default()).unwrap().rotation;
    assert_eq!((plan.frames[0].width, plan.frames[0].height), (48, 64));
    let picture = FrameLoader::new(&plan).load(0).unwrap();
    assert_eq!((picture.width, picture.height), (48, 64));
    // The bright quarter goes from the top left to the top right when turned clockwise, else to the bottom left.
    let bright = |x: usize, y: usize| picture.data[(y * 48 + x) * 3] > 200;
    let corners = [bright(5, 5), bright(40, 5), bright(5, 58), bright(40, 58)];
    assert_eq!(corners, [false, rotation == 90, rotation == 270, false], "turned by {rotation}");
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn real_clip() {
    let path = shared("data/mobile_robot/mobile_robot.mp4").expect("the clip");
    let plan = plan(&path, FrameChoice::count(4));
    let numbers: Vec<u32> = plan.frames.iter().map(|f| f.source_frame).collect();
    assert_eq!(numbers, [0, 16, 33, 49]);
    assert!((plan.frames[3].time_s.unwrap() - 49.0 / 30.0).abs() < 1e-3);
    let mut loader = FrameLoader::new(&plan);
    assert_eq!(loader.load(3).unwrap().width, 480);
    assert_eq!(loader.load(0).unwrap().height, 852);
}

#[test]
fn no_video_inside() {
    let dir = tempfile::tempdir().unwrap();
    let text = dir.path().join("text.mp4");
    fs::write(&text, "no video, only words\n".repeat(50)).unwrap();
    let error = probe(&[text.to_str().unwrap()], FrameChoice::all()).unwrap_err();
    assert!(matches!(&error, IoError::NotAVideo { .. }), "{error:?}");
    let empty = dir.path().join("empty.mp4");
    fs::write(&empty, "").unwrap();
    let error = probe(&[empty.to_str().unwrap()], FrameChoice::all()).unwrap_err();
    assert!(error.to_string().contains("it is empty, 0 bytes"), "{error}");
    let sound = dir.path().join("sound.mp4");
    ffmpeg(&["-f", "lavfi", "-i", "sine=duration=0.2", "-c:a", "aac", sound.to_str().unwrap()]);
    let error = probe(&[sound.to_str().unwrap()], FrameChoice::all()).unwrap_err();
    assert!(error.to_string().contains("no video stream"), "{error}");
}

/// Runs a test of this binary with other programs in the place of ffmpeg's.
fn with_variable(variable: &str, value: &str, test: &str) {
    let dir = tempfile::tempdir().unwrap();
    let path = clip(dir.path(), "a.mp4", 3, &[]);
    let output = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--ignored"])
        .env(variable, value)
        .env("OMNIX_TEST_CLIP", &path)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && text.contains("1 passed"), "{text}");
}

#[test]
fn missing_programs() {
    with_variable("OMNIX_FFPROBE", "/nowhere/ffprobe", "video::child_without_ffprobe");
    with_variable("OMNIX_FFMPEG", "/nowhere/ffmpeg", "video::child_without_ffmpeg");
}

#[test]
#[ignore = "run by missing_programs in a process of its own"]
fn child_without_ffprobe() {
    let path = std::env::var("OMNIX_TEST_CLIP").unwrap();
    let error = probe(&[path], FrameChoice::all()).unwrap_err();
    assert!(matches!(&error, IoError::MissingTool { tool: "ffprobe", .. }), "{error:?}");
    assert!(error.to_string().contains("install ffmpeg"), "{error}");
}

#[test]
#[ignore = "run by missing_programs in a process of its own"]
fn child_without_ffmpeg() {
    let path = std::env::var("OMNIX_TEST_CLIP").unwrap();
    let error = probe(&[path], FrameChoice::all()).unwrap_err();
    assert!(matches!(&error, IoError::MissingTool { tool: "ffmpeg", .. }), "{error:?}");
}
