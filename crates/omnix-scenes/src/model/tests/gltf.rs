//! glTF files.

use glam::DVec3;
use serde_json::json;

use super::samples::{Parts, flower, halves};
use super::*;

#[test]
fn a_skinned_and_blended_figure_moves_as_its_clips_say() {
    let dir = tempfile::tempdir().unwrap();
    flower().write(dir.path(), "flower.gltf");
    std::fs::write(dir.path().join("flower.glb"), flower().glb()).unwrap();
    for name in ["flower.gltf", "flower.glb"] {
        let (model, notes) = read(dir.path(), name);
        let model = model.unwrap();
        assert!(notes.is_empty() && model.is_animated() && model.known && model.clips() == 2, "{notes:?}");
        assert_eq!(model.triangles(), 4);
        // In the model's axes the file's y is z and its z is -y.
        let highest = |clip, t| {
            let all = model.positions(clip, t);
            all.into_iter().max_by(|a, b| a.z.total_cmp(&b.z)).unwrap()
        };
        let (up, pushed) = (highest(0, 0.0), highest(1, 0.999_999));
        assert!((up.z - 1.0).abs() < 1e-6, "{up}");
        // Forward is towards -y.
        assert!((pushed.y - up.y + 0.4).abs() < 1e-5 && (pushed.z - up.z).abs() < 1e-5, "{up} {pushed}");
        // Turned by a right angle the upper half lies to the left, its outer corner as high as the joint and half a width.
        let turned = model.positions(0, 0.999_999);
        let left = turned.iter().copied().min_by(|a, b| a.x.total_cmp(&b.x)).unwrap();
        assert!((left.x - up.x.min(0.0) + 0.4).abs() < 0.15 && left.z > 0.35 && left.z < 0.65, "{left} {turned:?}");
        // Clips repeat.
        assert!(model.positions(0, 0.25).iter().zip(model.positions(0, 7.25)).all(|(a, b)| a.distance(b) < 1e-9));
    }
}

#[test]
fn poses_of_nodes_and_textures_are_read() {
    let dir = tempfile::tempdir().unwrap();
    halves(&dir.path().join("halves.png"));
    let mut parts = Parts { json: json!({ "bufferViews": [], "accessors": [] }), bin: Vec::new() };
    let positions = parts.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0, 1.0, 0.0]);
    let places = parts.floats("VEC2", &[0.0, 1.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0]);
    let json = &mut parts.json;
    json["asset"] = json!({ "version": "2.0" });
    json["images"] = json!([{ "uri": "halves.png" }, { "uri": "none.png" }]);
    json["textures"] = json!([{ "source": 0 }, { "source": 1 }]);
    json["materials"] = json!([
        { "pbrMetallicRoughness": { "baseColorTexture": { "index": 0 } } },
        { "pbrMetallicRoughness": { "baseColorTexture": { "index": 1 } } },
    ]);
    // A fan without indices.
    json["meshes"] = json!([{ "primitives": [{ "mode": 6, "material": 0,
        "attributes": { "POSITION": positions, "TEXCOORD_0": places } }] }]);
    json["nodes"] =
        json!([{ "children": [1], "scale": [2, 1, 1] }, { "mesh": 0, "translation": [0, 3, 0] }, { "mesh": 0 }]);
    json["scenes"] = json!([{ "nodes": [0] }]);
    parts.write(dir.path(), "square.gltf");
    let (model, notes) = read(dir.path(), "square.gltf");
    let model = model.unwrap();
    assert!(notes.len() == 1 && notes[0].contains("texture"), "{notes:?}");
    // The node that is in no scene is not there.
    assert_eq!((model.triangles(), model.is_animated()), (2, false));
    assert!(model.size.distance(DVec3::new(2.0, 0.0, 1.0)) < 1e-9, "{}", model.size);
    let material = model.looks[0].material(1.0);
    for (position, rest) in model.mesh.positions.iter().zip(&model.mesh.rest) {
        let inside = *rest + (glam::Vec3::new(0.5, 0.5, 0.0) * material.scale - *rest) * 0.2;
        assert_eq!(material.colour(inside, glam::Vec3::Z, 1e-3).x > 0.5, position.x < 0.0);
        // The picture's lower edge is at the bottom.
        assert_eq!(rest.y < 0.5 * material.scale, position.z < 0.5);
    }
}

#[test]
fn files_that_cannot_be_used_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |change: &dyn Fn(&mut Parts)| {
        let mut parts = flower();
        change(&mut parts);
        parts.write(dir.path(), "bad.gltf");
        read(dir.path(), "bad.gltf").0.unwrap_err()
    };
    assert_eq!(refused(&|parts| parts.json["skins"][0]["joints"] = json!([])), Flaw::NoJoints);
    let bare = |parts: &mut Parts| {
        parts.json["meshes"][0]["primitives"][0]["attributes"].as_object_mut().unwrap().remove("JOINTS_0");
    };
    assert_eq!(refused(&bare), Flaw::NoJoints);
    assert_eq!(refused(&|parts| parts.json["skins"][0]["joints"] = json!([2])), Flaw::Index("a joint of a vertex"));
    let nan = |parts: &mut Parts| parts.bin[..4].copy_from_slice(&f32::NAN.to_le_bytes());
    assert_eq!(refused(&nan), Flaw::NotFinite("a position"));
    assert_eq!(refused(&|parts| parts.json["accessors"][0]["count"] = json!(7)), Flaw::Index("an accessor"));
    assert!(matches!(
        refused(&|parts| parts.json["accessors"][0]["count"] = json!(1_u64 << 40)),
        Flaw::Triangles { .. }
    ));
    assert_eq!(
        refused(&|parts| parts.json["bufferViews"][0]["byteLength"] = json!(1_000_000)),
        Flaw::Index("a view of a buffer")
    );
    assert!(matches!(refused(&|parts| parts.json["accessors"][1]["count"] = json!(3_000_003)), Flaw::Triangles { .. }));
    assert_eq!(refused(&|parts| parts.bin[6 * 12] = 77), Flaw::Index("a corner of a face"));
    assert!(matches!(refused(&|parts| parts.json["nodes"][1]["children"] = json!([2])), Flaw::Broken(_)));
    assert_eq!(
        refused(&|parts| parts.json["extensionsRequired"] = json!(["KHR_draco_mesh_compression"])),
        Flaw::Unsupported("KHR_draco_mesh_compression".to_owned())
    );
    assert_eq!(refused(&|parts| parts.json["meshes"][0]["primitives"][0]["mode"] = json!(1)), Flaw::Empty);
    assert!(matches!(refused(&|parts| parts.json["meshes"] = json!("none")), Flaw::Broken(_)));
    std::fs::remove_file(dir.path().join("a buffer.bin")).unwrap();
    assert!(matches!(read(dir.path(), "bad.gltf").0, Err(Flaw::Broken(_))));
    let file = flower().glb();
    std::fs::write(dir.path().join("half.glb"), &file[..file.len() / 2]).unwrap();
    assert!(matches!(read(dir.path(), "half.glb").0, Err(Flaw::Broken(_))));
}
