//! Folders, patterns and choices of frames, without decoding.

use std::{fs, time::Instant};

use omnix_io::{FrameChoice, FrameLoader, IoError, probe};
use serde_json::Value;

use crate::common::{data, pattern, save};

#[test]
fn sub_folders_are_videos_as_recorded() {
    let golden: Value = serde_json::from_slice(&fs::read(data("folders.json")).unwrap()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    for (folder, names) in golden["folders"].as_object().unwrap() {
        fs::create_dir(dir.path().join(folder)).unwrap();
        for name in names.as_array().unwrap() {
            let path = dir.path().join(folder).join(name.as_str().unwrap());
            if name.as_str().unwrap().ends_with("txt") {
                fs::write(path, "notes").unwrap();
            } else {
                save(&pattern(16, 8), &path);
            }
        }
    }
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::All).unwrap();
    let order: Vec<String> =
        plan.frames.iter().map(|f| f.path.strip_prefix(dir.path()).unwrap().to_str().unwrap().to_owned()).collect();
    assert_eq!(serde_json::to_value(&order).unwrap(), golden["order"]);
    let table: Vec<[usize; 4]> =
        plan.frames.iter().map(|f| [f.index, f.video as usize, f.frame as usize, f.index]).collect();
    assert_eq!(serde_json::to_value(&table).unwrap(), golden["image_video_frame_time"]);
    assert!(plan.frames.iter().all(|f| (f.width, f.height) == (16, 8) && f.time_s.is_none()));
    assert_eq!(plan.sources.len(), 4, "the empty folder counts");
}

#[test]
fn pictures_beside_sub_folders_are_mentioned() {
    let dir = tempfile::tempdir().unwrap();
    save(&pattern(4, 4), &dir.path().join("sub/a.png"));
    save(&pattern(4, 4), &dir.path().join("left.png"));
    let root = dir.path().to_str().unwrap();
    let plan = probe(&[root], FrameChoice::All).unwrap();
    assert_eq!((plan.frames.len(), plan.notes.len()), (1, 1));
    fs::remove_file(dir.path().join("sub/a.png")).unwrap();
    let plan = probe(&[root], FrameChoice::All).unwrap();
    assert!(plan.frames[0].path.ends_with("left.png") && plan.notes.len() == 1, "{plan:?}");
}

#[test]
fn patterns_and_several_inputs() {
    let dir = tempfile::tempdir().unwrap();
    for n in 0..12 {
        save(&pattern(20 + n, 10), &dir.path().join(format!("f{n:02}.JPG")));
    }
    fs::write(dir.path().join("f99.txt"), "no picture").unwrap();
    save(&pattern(5, 6), &dir.path().join("photo [1].bmp"));
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let plan = probe(&[at("f*"), at("photo [1].bmp")], FrameChoice::Count(4)).unwrap();
    let numbers: Vec<(u32, u32, u32)> = plan.frames.iter().map(|f| (f.video, f.frame, f.source_frame)).collect();
    assert_eq!(numbers, [(0, 0, 0), (0, 1, 4), (0, 2, 7), (0, 3, 11), (1, 0, 0)]);
    assert_eq!(plan.frames[3].width, 31);
    assert_eq!((plan.frames[4].width, plan.frames[4].height), (5, 6), "a name with brackets is a name first");
    assert!(plan.notes[0].contains("1 match"), "{:?}", plan.notes);
    let plan = probe(&[at("f*.JPG")], FrameChoice::Fps(2.0)).unwrap();
    assert_eq!(plan.frames.len(), 12, "pictures have no times");
    assert!(plan.notes.iter().any(|n| n.contains("carry no times")), "{:?}", plan.notes);
}

#[test]
fn formats_are_read_from_their_content() {
    let dir = tempfile::tempdir().unwrap();
    let made = pattern(37, 23);
    for name in ["a.png", "b.bmp", "c.webp", "d.jpeg", "e.PNG"] {
        let path = dir.path().join(name);
        save(&made, &path);
        if name == "a.png" {
            // A png that is named jpg is still a picture.
            fs::copy(&path, dir.path().join("z.jpg")).unwrap();
        }
    }
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::All).unwrap();
    let names: Vec<_> = plan.frames.iter().map(|f| f.path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["a.png", "b.bmp", "c.webp", "d.jpeg", "e.PNG", "z.jpg"], "sorted as text");
    let mut loader = FrameLoader::new(&plan);
    for frame in &plan.frames {
        assert_eq!((frame.width, frame.height), (37, 23), "{frame:?}");
        let picture = loader.load(frame.index).unwrap();
        if frame.path.ends_with("d.jpeg") {
            assert_eq!((picture.width, picture.height), (37, 23));
        } else {
            assert_eq!(picture, made, "{frame:?}");
        }
    }
}

#[test]
fn other_sample_types_become_rgb_as_in_pillow() {
    let dir = tempfile::tempdir().unwrap();
    let load = |image: image::DynamicImage| {
        let path = dir.path().join("x.png");
        image.save(&path).unwrap();
        omnix_io::input::load_picture(&path).unwrap().data
    };
    let rgba = image::RgbaImage::from_raw(2, 1, vec![10, 20, 30, 0, 40, 50, 60, 128]).unwrap();
    assert_eq!(load(rgba.into()), [10, 20, 30, 40, 50, 60], "alpha is dropped, not blended");
    let grey = image::GrayImage::from_raw(2, 1, vec![7, 200]).unwrap();
    assert_eq!(load(grey.into()), [7, 7, 7, 200, 200, 200]);
    let deep = image::ImageBuffer::<image::Luma<u16>, _>::from_raw(2, 1, vec![0x12ffu16, 0xff00]).unwrap();
    assert_eq!(load(deep.into()), [0x12, 0x12, 0x12, 0xff, 0xff, 0xff], "the high byte");
    let deep = image::ImageBuffer::<image::Rgb<u16>, _>::from_raw(1, 1, vec![0x01ffu16, 0x0280, 0x0300]).unwrap();
    assert_eq!(load(deep.into()), [1, 2, 3]);
}

#[test]
fn ten_thousand_frames_are_planned_quickly() {
    let dir = tempfile::tempdir().unwrap();
    let first = dir.path().join("00000.jpg");
    save(&pattern(640, 480), &first);
    // Links to one file: as many opens and header reads as ten thousand files.
    for n in 1..10_000 {
        fs::hard_link(&first, dir.path().join(format!("{n:05}.jpg"))).unwrap();
    }
    let start = Instant::now();
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::All).unwrap();
    let elapsed = start.elapsed();
    assert_eq!(plan.frames.len(), 10_000);
    assert!(elapsed.as_secs_f64() < 3.0, "{elapsed:?}");
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::Count(16)).unwrap();
    assert_eq!((plan.frames.len(), plan.frames[15].source_frame), (16, 9999));
}

#[test]
fn choices_of_nothing_are_refused() {
    for choice in [FrameChoice::Count(0), FrameChoice::Fps(-1.0)] {
        let error = probe(&["anything"], choice).unwrap_err();
        assert!(matches!(error, IoError::BadChoice { .. }), "{error}");
    }
}
