//! Wavefront OBJ with its MTL: positions, texture coordinates, faces, diffuse colours and textures.
//!
//! The file's normals are not read: many files lack them or have them the wrong way round. Materials that are all but transparent
//! are left out with their faces; other transparent ones are solid.

use std::path::Path;

use glam::{DVec3, Vec2, Vec3};
use tobj::{LoadOptions, MTLLoadResult};

use super::flaw::Flaw;
use super::raw::{Face, Look, MOST_TRIANGLES, Raw};
use super::texture::Textures;
use crate::assets::store::Store;
use crate::lens::linear;

/// An OBJ has fewer bytes than this: a million triangles have about 80 MB.
const MOST_BYTES: u64 = 256 << 20;
/// An MTL has fewer bytes than this.
const MOST_MATERIAL_BYTES: u64 = 16 << 20;
/// What is less opaque than this is left out.
const CLEAR: f32 = 0.15;

/// Reads a model. What is no reason to refuse it is told to `note`.
pub(crate) fn read_obj(store: &Store, name: &str, note: &mut dyn FnMut(String)) -> Result<Raw, Flaw> {
    let bytes = store.read(name, MOST_BYTES)?;
    let text = String::from_utf8_lossy(&bytes);
    // Before anything is made of it.
    let count = triangles(&text);
    if count > MOST_TRIANGLES {
        return Err(Flaw::Triangles { count, most: MOST_TRIANGLES });
    }
    let options = LoadOptions { triangulate: true, ignore_points: true, ignore_lines: true, ..LoadOptions::default() };
    let materials = |path: &Path| materials(store, name, path);
    let (parts, materials) = tobj::load_obj_buf(&mut text.as_bytes(), &options, materials)
        .map_err(|error| Flaw::Broken(error.to_string()))?;
    let materials = materials.unwrap_or_else(|_| {
        note("its materials cannot be read, so it is grey".to_owned());
        Vec::new()
    });
    let mut textures = Textures::new(store, name);
    let mut raw = Raw { looks: vec![Look::plain(Vec3::splat(0.6))], ..Raw::default() };
    let mut clear = Vec::new();
    for material in &materials {
        raw.looks.push(look(material, &mut textures, note)?);
        clear.push(material.dissolve.is_some_and(|d| d < CLEAR));
    }
    for part in parts {
        let mesh = part.mesh;
        let material = mesh.material_id.filter(|&id| id < materials.len());
        if material.is_some_and(|id| clear[id]) {
            continue;
        }
        let [first, first_place] = [raw.positions.len() as u32, raw.places.len() as u32];
        raw.positions.extend(mesh.positions.chunks_exact(3).map(|p| DVec3::new(p[0].into(), p[1].into(), p[2].into())));
        raw.places.extend(mesh.texcoords.chunks_exact(2).map(|p| Vec2::new(p[0], p[1])));
        let look = material.map_or(0, |id| id + 1).min(usize::from(u16::MAX)) as u16;
        let has_places = mesh.texcoord_indices.len() == mesh.indices.len();
        for (k, corners) in mesh.indices.chunks_exact(3).enumerate() {
            let places = has_places.then(|| [0, 1, 2].map(|j| first_place + mesh.texcoord_indices[3 * k + j]));
            raw.faces.push(Face { corners: [corners[0], corners[1], corners[2]].map(|c| first + c), places, look });
        }
    }
    Ok(raw)
}

/// How many triangles the faces of a file make.
fn triangles(text: &str) -> usize {
    let faces = text.lines().map(str::trim_start).filter(|line| line.starts_with("f ") || line.starts_with("f\t"));
    faces.map(|face| face.split_ascii_whitespace().count().saturating_sub(3)).sum()
}

fn materials(store: &Store, name: &str, path: &Path) -> MTLLoadResult {
    let found = store.find(name, &path.to_string_lossy()).ok_or(tobj::LoadError::OpenFileFailed)?;
    let bytes = store.read(found, MOST_MATERIAL_BYTES).map_err(|_| tobj::LoadError::ReadError)?;
    tobj::load_mtl_buf(&mut String::from_utf8_lossy(&bytes).as_bytes())
}

fn look(material: &tobj::Material, textures: &mut Textures, note: &mut dyn FnMut(String)) -> Result<Look, Flaw> {
    let unit = |v: f32| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.5 };
    // Nothing real is quite black or quite white.
    let colour = Vec3::from_array(material.diffuse.unwrap_or([0.6; 3])).map(|v| linear(0.03 + 0.92 * unit(v)));
    let shine = material.specular.unwrap_or_default().map(unit).iter().sum::<f32>() / 3.0;
    let power = material.shininess.filter(|power| power.is_finite()).unwrap_or(0.0).clamp(0.0, 1000.0);
    let mut look = Look {
        gloss: 0.02 + 0.06 * shine,
        rough: (2.0 / (power + 2.0)).sqrt().clamp(0.15, 1.0),
        ..Look::plain(colour)
    };
    if let Some(reference) = &material.diffuse_texture {
        // Options before the name: what is wanted is the last word, but names may have spaces.
        let last = || reference.split_whitespace().next_back().unwrap_or_default();
        let whole = textures.get(reference)?;
        match whole.map_or_else(|| textures.get(last()), |photo| Ok(Some(photo)))? {
            Some(photo) => {
                // What programs write as the colour of a textured material means little.
                look.colour = Vec3::ONE;
                look.texture = Some(photo);
            }
            None => note(format!("its texture {reference} is missing or broken, so one colour is used")),
        }
    }
    Ok(look)
}
