//! Folders, patterns and choices of frames, without decoding.

use std::{fs, time::Instant};

use omnix_io::{FrameChoice, FrameLoader, InputPlan, IoError, probe};
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
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::all()).unwrap();
    let order: Vec<String> =
        plan.frames.iter().map(|f| f.path.strip_prefix(dir.path()).unwrap().to_str().unwrap().to_owned()).collect();
    // The reference sorts names as text; here numbers count, so that frame 2 comes before frame 10.
    let mut expected: Vec<String> = serde_json::from_value(golden["order"].clone()).unwrap();
    assert_eq!(expected[1..3], ["b/10.png", "b/9.png"]);
    expected.swap(1, 2);
    assert_eq!(order, expected);
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
    let plan = probe(&[root], FrameChoice::all()).unwrap();
    assert_eq!((plan.frames.len(), plan.notes.len()), (1, 1));
    fs::remove_file(dir.path().join("sub/a.png")).unwrap();
    let plan = probe(&[root], FrameChoice::all()).unwrap();
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
    let plan = probe(&[at("f*"), at("photo [1].bmp")], FrameChoice::count(4)).unwrap();
    let numbers: Vec<(u32, u32, u32)> = plan.frames.iter().map(|f| (f.video, f.frame, f.source_frame)).collect();
    assert_eq!(numbers, [(0, 0, 0), (0, 1, 4), (0, 2, 7), (0, 3, 11), (1, 0, 0)]);
    assert_eq!(plan.frames[3].width, 31);
    assert_eq!((plan.frames[4].width, plan.frames[4].height), (5, 6), "a name with brackets is a name first");
    assert!(plan.notes[0].contains("1 file or folder(s) (f99.txt) not read"), "{:?}", plan.notes);
    let plan = probe(&[at("f*.JPG")], FrameChoice::fps(2.0)).unwrap();
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
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::all()).unwrap();
    let names: Vec<_> = plan.frames.iter().map(|f| f.path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, ["a.png", "b.bmp", "c.webp", "d.jpeg", "e.PNG", "z.jpg"]);
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
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::all()).unwrap();
    let elapsed = start.elapsed();
    assert_eq!(plan.frames.len(), 10_000);
    assert!(elapsed.as_secs_f64() < 3.0, "{elapsed:?}");
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::count(16)).unwrap();
    assert_eq!((plan.frames.len(), plan.frames[15].source_frame), (16, 9999));
}

#[test]
fn choices_of_nothing_are_refused() {
    for choice in [FrameChoice::count(0), FrameChoice::fps(-1.0)] {
        let error = probe(&["anything"], choice).unwrap_err();
        assert!(matches!(error, IoError::BadChoice { .. }), "{error}");
    }
}

#[test]
fn numbers_in_names_count() {
    let dir = tempfile::tempdir().unwrap();
    for n in [1, 2, 10, 11] {
        save(&pattern(8, 8), &dir.path().join(format!("frame{n}.png")));
        save(&pattern(8, 8), &dir.path().join(format!("sub{n}/a.png")));
    }
    let names = |plan: &InputPlan, level: usize| -> Vec<String> {
        let name = |f: &omnix_io::PlannedFrame| f.path.iter().rev().nth(level).unwrap().to_str().unwrap().to_owned();
        plan.frames.iter().map(name).collect()
    };
    let plan = probe(&[dir.path().join("frame*.png").to_str().unwrap()], FrameChoice::all()).unwrap();
    assert_eq!(names(&plan, 0), ["frame1.png", "frame2.png", "frame10.png", "frame11.png"]);
    let plan = probe(&[dir.path().to_str().unwrap()], FrameChoice::all()).unwrap();
    assert_eq!(names(&plan, 1), ["sub1", "sub2", "sub10", "sub11"]);
}

#[test]
fn hidden_files_are_passed_over_and_others_are_named() {
    let dir = tempfile::tempdir().unwrap();
    save(&pattern(8, 8), &dir.path().join("a.png"));
    for hidden in ["._a.png", ".DS_Store", ".thumbs/a.png", "__MACOSX/a.png", ".ipynb_checkpoints/a.png"] {
        let path = dir.path().join(hidden);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        fs::write(path, "no picture").unwrap();
    }
    let root = dir.path().to_str().unwrap();
    let plan = probe(&[root], FrameChoice::all()).unwrap();
    assert_eq!((plan.frames.len(), plan.sources.len(), plan.notes.len()), (1, 1, 0), "{:?}", plan.notes);
    for other in ["IMG_1.HEIC", "IMG_2.HEIC", "clip.mp4", "old.svg", "notes.txt", "labels.json", "b.json"] {
        fs::write(dir.path().join(other), "not read").unwrap();
    }
    let plan = probe(&[root], FrameChoice::all()).unwrap();
    assert_eq!((plan.frames.len(), plan.notes.len()), (1, 1), "{:?}", plan.notes);
    for words in ["7 file(s)", "clip.mp4", "IMG_1.HEIC", "...", "a video is an input of its own"] {
        assert!(plan.notes[0].contains(words), "no {words} in {:?}", plan.notes);
    }
}

#[test]
fn what_a_choice_could_not_do_is_said() {
    let dir = tempfile::tempdir().unwrap();
    for name in ["a/1.png", "a/2.png", "b.png", "c.png"] {
        save(&pattern(8, 8), &dir.path().join(name));
    }
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let plan = probe(&[at("a")], FrameChoice::count(64)).unwrap();
    assert!(plan.notes[0].contains("64 frames were asked for and 2 are there"), "{:?}", plan.notes);
    assert!(probe(&[at("a")], FrameChoice::count(2)).unwrap().notes.is_empty());
    let plan = probe(&[at("b.png"), at("c.png")], FrameChoice::count(64)).unwrap();
    assert!(plan.notes.len() == 1 && plan.notes[0].contains("each is a video of its own"), "{:?}", plan.notes);
    assert!(probe(&[at("b.png"), at("a")], FrameChoice::all()).unwrap().notes.is_empty());
    let plan = probe(&[at("a")], FrameChoice::all().between(Some(1.0), None)).unwrap();
    assert!(plan.frames.len() == 2 && plan.notes[0].contains("carry no times"), "{:?}", plan.notes);
}
