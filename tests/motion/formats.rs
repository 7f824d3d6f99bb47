//! Every export format of the list: it opens, it writes, and what it leaves is what it states.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use omnix_io::output::motion::SourceMotion;
use omnix_io::output::{FeatureMap, MotionInput, MotionOptions, MotionStream, write_motion};
use omnix_io::{Export, FrameResult, RunSize, RunSummary, SinkOptions, open_sinks};

use omnix_geometry::GAUSSIAN_NUMBERS;

use crate::made::{self, HEIGHT, PIXELS, WIDTH, position};

/// Three images, the last of a second video.
const IMAGES: usize = 3;

fn size(motion: bool, all_pixels: bool) -> RunSize {
    let points = (IMAGES * PIXELS) as u64;
    let size = RunSize::default().images(IMAGES as u64).videos(2).pixels(PIXELS as u64);
    size.motion(motion).followed(points).all_pixels(all_pixels)
}

/// Writes what `export` makes of the made-up scene.
fn write(export: Export, dir: &Path, size: &RunSize) -> Vec<PathBuf> {
    let mut written = Vec::new();
    let views = made::views(IMAGES);
    for mut sink in open_sinks(&[export], dir, &SinkOptions::default()).unwrap() {
        for (index, view) in views.iter().enumerate() {
            let frame = FrameResult {
                index,
                video: view.time.video,
                frame: view.time.frame,
                time_s: view.time.time_s,
                width: WIDTH,
                height: HEIGHT,
                depth: &[2.5; PIXELS],
                confidence: Some(&[1.5; PIXELS]),
                rgb: &view.picture.data,
                extrinsics: Some(view.extrinsics),
                intrinsics: Some(view.intrinsics),
                sky: None,
                gaussians: Some(&[0.5; GAUSSIAN_NUMBERS * PIXELS]),
                features: &[FeatureMap { block: 3, grid: [1, 1], values: &[0.5; 8] }],
                source: None,
            };
            sink.frame(&frame).unwrap();
        }
        written.extend(sink.finish(&RunSummary::default()).unwrap());
    }
    let input = export.motion_input_of(size.all_pixels).filter(|_| size.motion);
    match input {
        Some(MotionInput::Points) => {
            let points = made::points(IMAGES, 1);
            written.extend(write_motion(&[export], &points, dir, &MotionOptions::default()).unwrap());
        }
        Some(MotionInput::Images) => {
            let mut stream = MotionStream::open(&[export], views, dir).unwrap();
            for index in 0..IMAGES {
                let at = |time: usize| (0..PIXELS).flat_map(move |p| position(index, p, time));
                let (points, paths): (Vec<f32>, Vec<f32>) = (at(index).collect(), (0..IMAGES).flat_map(at).collect());
                let image = SourceMotion {
                    index,
                    pixels: None,
                    points: &points,
                    trajectory: stream.wants_trajectory(index).then_some(&paths),
                    confidence: &[1.5; PIXELS],
                    motion: &[0.5; PIXELS],
                    moving: &[true; PIXELS],
                };
                stream.image(&image).unwrap();
            }
            written.extend(stream.finish());
        }
        None => {}
    }
    written
}

/// Names of all files in a folder and those below it.
fn names(dir: &Path) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![dir.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                open.push(path);
            } else {
                found.insert(path.strip_prefix(dir).unwrap().to_str().unwrap().replace('\\', "/"));
            }
        }
    }
    found
}

#[test]
fn what_each_leaves_is_what_it_states() {
    for &export in Export::ALL {
        for (motion, all_pixels) in [(false, false), (true, false), (true, true)] {
            // The library writes the field, from numbers that are on the device (tests/field).
            if export == Export::Field || (export.needs_motion() && !motion) {
                continue;
            }
            let dir = tempfile::tempdir().unwrap();
            let size = size(motion, all_pixels);
            let written = write(export, dir.path(), &size);
            let stated: BTreeSet<String> = export.files(&size).into_iter().collect();
            assert!(!stated.is_empty(), "{export}");
            assert_eq!(names(dir.path()), stated, "{export}, motion {motion}, all pixels {all_pixels}");
            let listed = written.iter().map(|path| path.strip_prefix(dir.path()).unwrap().to_str().unwrap().to_owned());
            assert_eq!(listed.collect::<BTreeSet<_>>(), stated, "{export}: the paths it returned");
            let bytes: u64 = stated.iter().map(|name| fs::metadata(dir.path().join(name)).unwrap().len()).sum();
            // Headers weigh more than this small scene.
            let headers = 8000 * stated.len() as u64;
            assert!(bytes <= export.disk_bytes(&size) + headers, "{export} took {bytes} bytes");
            for name in &stated {
                assert!(Export::leaves(name), "{name}");
            }
        }
    }
    assert!(!Export::leaves("photo.png") && !Export::leaves("depth/photo.png") && !Export::leaves("manifest.json"));
}

#[test]
fn names_are_unique_and_in_the_readme() {
    let names: BTreeSet<&str> = Export::ALL.iter().map(|e| e.name()).collect();
    // Each can be asked for by its name.
    assert!(Export::ALL.iter().all(|e| Export::parse_list(e.name()).is_ok_and(|list| list == [*e])));
    assert_eq!(names.len(), Export::ALL.len());
    let readme = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../README.md")).unwrap();
    let table: Vec<&str> = readme.lines().skip_while(|l| !l.starts_with("| `--export`")).collect();
    for name in names {
        let row = table.iter().take_while(|l| l.starts_with('|')).any(|l| l.contains(&format!("`{name}`")));
        assert!(row, "README.md's table of exports lacks {name}");
    }
}
