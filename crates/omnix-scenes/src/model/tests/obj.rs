//! OBJ files.

use glam::{DVec3, Vec2};

use super::samples::{BOX, halves};
use super::*;
use crate::material::Pattern;

#[test]
fn a_box_is_read_with_its_looks() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), BOX).unwrap();
    std::fs::write(
        dir.path().join("box.mtl"),
        b"# c\xf4t\xe9\nnewmtl red\nKd 0.9 0.1 0.1\nNs 100\nKs 1 1 1\nnewmtl print\nKd 0 0 0\nmap_Kd a print.png\n\
         newmtl glass\nKd 1 1 1\nd 0.05\n",
    )
    .unwrap();
    halves(&dir.path().join("a print.png"));
    let (model, notes) = read(dir.path(), "box.obj");
    let model = model.unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    // The file's y is up, and its longest side is made 1; the sixth face is of glass and left out.
    assert_eq!((model.triangles(), model.known), (10, false));
    assert!(model.size.distance(DVec3::new(0.5, 0.25, 1.0)) < 1e-12, "{}", model.size);
    let [low, high] = model.mesh.bounds();
    assert!(
        low.distance(DVec3::new(-0.25, -0.125, 0.0)) < 1e-12 && high.distance(DVec3::new(0.25, 0.125, 1.0)) < 1e-12
    );
    // All faces look outwards, with corners of their own at the sharp edges.
    let normals = crate::mesh::vertex_normals(&model.mesh.positions, &model.mesh.triangles);
    let middle = (low + high) / 2.0;
    assert!(normals.iter().zip(&model.mesh.positions).all(|(n, p)| n.as_dvec3().dot(*p - middle) > 0.0));
    assert_eq!(model.mesh.positions.len(), 20);
    let [_, red, print, _] = &model.looks[..] else { panic!("{}", model.looks.len()) };
    assert!(red.colour.x > 0.5 && red.colour.y < 0.1 && red.rough < 0.2);
    // The front, whose texture spans its width once: red on the left.
    let slot = model.looks.iter().position(|look| look.texture.is_some()).unwrap();
    let front: Vec<usize> = (0..10).filter(|&k| usize::from(model.mesh.slots[k]) == slot).collect();
    assert_eq!(front.len(), 2);
    let material = print.material(1.0);
    assert!(matches!(material.pattern, Pattern::Wrapped(_)));
    for &corner in front.iter().flat_map(|&k| &model.mesh.triangles[k]) {
        let (position, rest) = (model.mesh.positions[corner as usize], model.mesh.rest[corner as usize]);
        assert_eq!(position.y, -0.125);
        let place = Vec2::new(rest.x, rest.y) / material.scale;
        assert!((place.x - if position.x > 0.0 { 1.0 } else { 0.0 }).abs() < 1e-5, "{place}");
        let inside = rest + (glam::Vec3::new(0.5, 0.5, 0.0) * material.scale - rest) * 0.2;
        let colour = material.colour(inside, glam::Vec3::Z, 1e-3);
        assert_eq!(colour.x > 0.5, position.x < 0.0, "{colour}");
    }
}

#[test]
fn what_is_missing_is_told_and_replaced() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("box.obj"), BOX).unwrap();
    let (model, notes) = read(dir.path(), "box.obj");
    assert_eq!(model.unwrap().triangles(), 12);
    assert!(notes.len() == 1 && notes[0].contains("materials"), "{notes:?}");
    std::fs::write(dir.path().join("box.mtl"), "newmtl print\nKd 0.2 0.9 0.2\nmap_Kd nowhere.png\n").unwrap();
    let (model, notes) = read(dir.path(), "box.obj");
    assert!(model.unwrap().looks[1].colour.y > 0.7);
    assert!(notes.len() == 1 && notes[0].contains("nowhere.png"), "{notes:?}");
}

#[test]
fn files_that_cannot_be_used_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |text: &str| {
        std::fs::write(dir.path().join("bad.obj"), text).unwrap();
        read(dir.path(), "bad.obj").0.unwrap_err()
    };
    let corners = "v 0 0 0\nv 1 0 0\nv 0 1 0\n";
    assert!(matches!(refused("v 0 0 x\nf 1 1 1\n"), Flaw::Broken(_)));
    assert!(matches!(refused(&format!("{corners}f 1 2 9\n")), Flaw::Broken(_) | Flaw::Index(_)));
    assert!(matches!(refused(&format!("{corners}f 1 2 -9\n")), Flaw::Broken(_) | Flaw::Index(_)));
    assert_eq!(refused("v 0 0 0\nv nan 0 0\nv 0 1 0\nf 1 2 3\n"), Flaw::NotFinite("a position"));
    assert_eq!(refused("v 0 0 0\nv inf 0 0\nv 0 1 0\nf 1 2 3\n"), Flaw::NotFinite("a position"));
    assert_eq!(refused(corners), Flaw::Empty);
    assert_eq!(refused(&format!("{corners}f 1 1 2\n")), Flaw::Empty);
    assert_eq!(refused(""), Flaw::Empty);
    let many = corners.to_owned() + &"f 1 2 3\n".repeat(1_000_001);
    assert_eq!(refused(&many), Flaw::Triangles { count: 1_000_001, most: 1_000_000 });
    // One face of many corners is many triangles.
    let wide = format!("{corners}f{}\n", " 1 2 3".repeat(400_000));
    assert!(matches!(refused(&wide), Flaw::Triangles { count: 1_199_998, .. }));
    let see_through = image::RgbaImage::from_fn(8, 8, |x, _| image::Rgba([9, 9, 9, if x < 4 { 0 } else { 255 }]));
    see_through.save(dir.path().join("leaf.png")).unwrap();
    std::fs::write(dir.path().join("leaf.mtl"), "newmtl leaf\nmap_Kd leaf.png\n").unwrap();
    assert_eq!(refused(&format!("mtllib leaf.mtl\n{corners}usemtl leaf\nf 1 2 3\n")), Flaw::SeeThrough);
}
