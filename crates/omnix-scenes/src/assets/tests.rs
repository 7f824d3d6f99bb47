//! Folders that the tests write.

use std::fs::{self, File};
use std::io::Write as _;

use zip::write::SimpleFileOptions;

use super::*;
use crate::model::samples::{BOX, flower, halves};

fn library(path: &Path, files: &[(&str, &[u8])]) {
    let mut zip = zip::ZipWriter::new(File::create(path).unwrap());
    for (name, bytes) in files {
        zip.start_file(*name, SimpleFileOptions::default()).unwrap();
        zip.write_all(bytes).unwrap();
    }
    zip.finish().unwrap();
}

#[test]
fn one_folder_holds_photographs_models_and_libraries() {
    let dir = tempfile::tempdir().unwrap();
    let models = dir.path().join("models");
    fs::create_dir(&models).unwrap();
    halves(&dir.path().join("photo.png"));
    halves(&models.join("print.png"));
    fs::write(models.join("box.obj"), BOX).unwrap();
    fs::write(models.join("box.mtl"), "newmtl print\nmap_Kd print.png\nnewmtl red\nnewmtl glass\n").unwrap();
    fs::write(models.join("flower.glb"), flower().glb()).unwrap();
    fs::write(models.join("broken.gltf"), "{").unwrap();
    fs::write(dir.path().join("notes.txt"), "nothing").unwrap();
    let catalogue = "model#1=/a/box.obj\nwidth#1=60\ndepth#1=40\nheight#1=200\ndropOnTopElevation#1=200\nmodel#2=/a/door.obj\nwidth#2=90\n\
        depth#2=10\nheight#2=200\ndoorOrWindow#2=true\nmodel#3=/a/none.obj\nwidth#3=1\ndepth#3=1\nheight#3=1\nmodel#4=/a/box.obj\n";
    library(
        &dir.path().join("all.sh3f"),
        &[
            ("PluginFurnitureCatalog.properties", catalogue.as_bytes()),
            ("a/box.obj", BOX.as_bytes()),
            ("a/icon.png", b"none"),
        ],
    );
    fs::write(dir.path().join("broken.zip"), "no archive").unwrap();
    let assets = Assets::read(dir.path()).unwrap();
    // The texture of the box is no photograph.
    assert_eq!(assets.photos.len(), 1);
    let names: Vec<bool> = assets.models.iter().map(|model| model.is_animated()).collect();
    assert_eq!(names, [false, true, false], "{:?}", assets.notes);
    let piece = &assets.models[2];
    assert!(piece.known && piece.size.distance(glam::DVec3::new(0.6, 0.4, 2.0)) < 1e-9 && piece.top == Some(2.0));
    assert!(piece.name().ends_with("all.sh3f/a/box.obj"));
    for part in ["broken.zip: it cannot be read", "2 left out", "broken.gltf: left out", "box.obj: its materials"] {
        assert!(assets.notes.iter().any(|note| note.contains(part)), "{part}: {:?}", assets.notes);
    }
    assert_eq!(assets.notes.len(), 4);
    // The same folder gives the same models, and another look another digest.
    let again = Assets::read(dir.path()).unwrap();
    assert_eq!(again.identity(), assets.identity());
    fs::write(models.join("box.mtl"), "newmtl print\nnewmtl red\nKd 1 0 0\nnewmtl glass\n").unwrap();
    assert_ne!(Assets::read(dir.path()).unwrap().identity(), assets.identity());
}

#[test]
fn folders_of_nothing_and_of_broken_files_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let error = || Assets::read(dir.path()).unwrap_err().to_string();
    assert!(error().contains("no JPEG"), "{}", error());
    fs::write(dir.path().join("bad.obj"), "v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
    assert!(error().contains("bad.obj") && error().contains("NaN"), "{}", error());
    fs::write(dir.path().join("broken.jpg"), "no picture").unwrap();
    assert!(error().contains("broken.jpg"), "{}", error());
    let none = dir.path().join("none");
    assert!(matches!(Assets::read(&none), Err(ScenesError::Read { .. })));
}

#[test]
fn many_files_are_chosen_evenly() {
    assert_eq!(evenly((0..10).collect(), 4), [0, 2, 5, 7]);
    assert_eq!(evenly((0..3).collect(), 4), [0, 1, 2]);
    assert!(evenly(Vec::<u8>::new(), 4).is_empty());
}
