//! glTF 2.0 and GLB: meshes on their nodes, base colours and textures, skins, shapes to blend, and animations.

mod moves;
mod numbers;

use std::collections::HashMap;
use std::sync::Arc;

use glam::{DVec3, Vec2, Vec3};
use gltf::mesh::Mode;
use gltf::{Gltf, Material, Primitive, Semantic, image, material::AlphaMode};

use self::numbers::{Buffers, resource};
use super::flaw::Flaw;
use super::puppet::{Part, Puppet};
use super::raw::{Face, Look, MOST_TRIANGLES, Raw};
use super::texture::decoded;
use crate::assets::store::Store;
use crate::photo::Photo;

/// A file has fewer bytes than this.
const MOST_BYTES: u64 = 256 << 20;
/// A picture of it has fewer bytes than this.
const MOST_PICTURE: u64 = 64 << 20;
/// What is less opaque than this is left out.
const CLEAR: f32 = 0.15;

/// Textures by the picture's index, and whether their holes do not count; nothing for broken ones.
type Pictures = HashMap<(usize, bool), Option<Arc<Photo>>>;

/// Reads a model as its file poses it, and what moves it. What is no reason to refuse it is told to `note`.
pub(crate) fn read_gltf(store: &Store, name: &str, note: &mut dyn FnMut(String)) -> Result<(Raw, Puppet), Flaw> {
    let bytes = store.read(name, MOST_BYTES)?;
    let file = Gltf::from_slice(&bytes).map_err(|error| {
        // The first error is that of a required extension where there is one that is not known.
        let loose = Gltf::from_slice_without_validation(&bytes);
        let needed = loose.ok().and_then(|file| file.extensions_required().next().map(str::to_owned));
        needed.map_or_else(|| Flaw::Broken(error.to_string()), Flaw::Unsupported)
    })?;
    let buffers = Buffers::read(&file, store, name)?;
    let looks = looks(&file, &buffers, store, name, note)?;
    let plain = looks.len() - 1;
    let mut reader = Reader { buffers, looks, plain, raw: Raw::default(), corners: 0 };
    let (nodes, order) = moves::nodes(&file)?;
    let mut puppet = Puppet { nodes, skins: moves::skins(&file, &reader.buffers, &order)?, ..Puppet::default() };
    for node in drawn(&file) {
        let Some(mesh) = node.mesh() else { continue };
        let skin = node.skin().map(|skin| skin.index());
        let joints = skin.map(|skin| puppet.skins[skin].joints.len());
        for primitive in mesh.primitives() {
            if let Some(part) = reader.part(&primitive, order[node.index()], skin.zip(joints))? {
                puppet.parts.push(part);
            }
        }
    }
    puppet.clips = moves::clips(&file, &reader.buffers, &order)?;
    let mut raw = reader.raw;
    raw.looks = reader.looks.into_iter().map(|(look, _)| look).collect();
    raw.positions = puppet.positions(None, 0.0);
    Ok((raw, puppet))
}

/// The nodes of the scene that is shown; all of them where the file has no scene.
fn drawn(file: &Gltf) -> Vec<gltf::Node<'_>> {
    let Some(scene) = file.default_scene().or_else(|| file.scenes().next()) else {
        return file.nodes().collect();
    };
    let mut all = Vec::new();
    let mut waiting: Vec<gltf::Node> = scene.nodes().collect();
    // Circles of nodes were refused before.
    while let Some(node) = waiting.pop() {
        waiting.extend(node.children());
        all.push(node);
    }
    all.sort_by_key(gltf::Node::index);
    all.dedup_by_key(|node| node.index());
    all
}

/// The looks of all materials, and whether they are left out; last, that of what has no material.
fn looks(
    file: &Gltf,
    buffers: &Buffers,
    store: &Store,
    name: &str,
    note: &mut dyn FnMut(String),
) -> Result<Vec<(Look, bool)>, Flaw> {
    let mut looks = Vec::new();
    let mut known = Pictures::new();
    for material in file.materials() {
        looks.push(look(&material, buffers, store, name, &mut known, note)?);
    }
    looks.push((Look::plain(Vec3::splat(0.6)), false));
    Ok(looks)
}

fn look(
    material: &Material,
    buffers: &Buffers,
    store: &Store,
    name: &str,
    known: &mut Pictures,
    note: &mut dyn FnMut(String),
) -> Result<(Look, bool), Flaw> {
    let surface = material.pbr_metallic_roughness();
    let [r, g, b, alpha] = surface.base_color_factor();
    let unit = |v: f32| if v.is_finite() { v.clamp(0.0, 1.0) } else { 0.5 };
    let metal = unit(surface.metallic_factor());
    let mut look = Look {
        gloss: 0.04 + 0.5 * metal,
        rough: unit(surface.roughness_factor()).clamp(0.15, 1.0),
        ..Look::plain(Vec3::new(r, g, b).map(|v| 0.003 + 0.9 * unit(v)))
    };
    let solid = material.alpha_mode() == AlphaMode::Opaque;
    if let Some(texture) = surface.base_color_texture() {
        let picture = texture.texture().source();
        let photo = match known.get(&(picture.index(), solid)) {
            Some(photo) => photo.clone(),
            None => {
                let bytes = match picture.source() {
                    image::Source::Uri { uri, .. } => resource(uri, store, name, MOST_PICTURE).ok(),
                    image::Source::View { view, .. } => buffers.view(&view).ok().map(<[u8]>::to_vec),
                };
                let photo = bytes.map_or(Ok(None), |bytes| decoded(&bytes, solid))?;
                known.insert((picture.index(), solid), photo.clone());
                photo
            }
        };
        match photo {
            Some(photo) => look.texture = Some(photo),
            None => note("a texture of it is missing or broken, so one colour is used".to_owned()),
        }
    }
    Ok((look, !solid && alpha < CLEAR))
}

/// What was read of a file so far.
struct Reader {
    buffers: Buffers,
    looks: Vec<(Look, bool)>,
    /// The look of what has no material.
    plain: usize,
    raw: Raw,
    /// Positions of all parts together.
    corners: usize,
}

impl Reader {
    /// The vertices of a primitive, whose faces are added; nothing for one without triangles or that is transparent.
    fn part(&mut self, primitive: &Primitive, node: usize, skin: Option<(usize, usize)>) -> Result<Option<Part>, Flaw> {
        let none = self.plain;
        let mut look = primitive.material().index().unwrap_or(none);
        let Some(positions) = primitive.get(&Semantic::Positions) else { return Ok(None) };
        if !matches!(primitive.mode(), Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) || self.looks[look].1
        {
            return Ok(None);
        }
        let count = positions.count();
        let ends = primitive.indices().map_or(count, |indices| indices.count());
        let mode = primitive.mode();
        let triangles = if mode == Mode::Triangles { ends / 3 } else { ends.saturating_sub(2) };
        let all = self.raw.faces.len().saturating_add(triangles);
        // Before any memory is taken for them.
        if all > MOST_TRIANGLES || self.corners.saturating_add(count) > 3 * MOST_TRIANGLES {
            return Err(Flaw::Triangles { count: all.max((self.corners + count) / 3), most: MOST_TRIANGLES });
        }
        let base: Vec<DVec3> = self.buffers.numbers(&positions)?.into_iter().map(DVec3::from_array).collect();
        let ends: Vec<u32> = match primitive.indices() {
            Some(indices) => self.buffers.numbers::<1>(&indices)?.into_iter().map(|[k]| k as u32).collect(),
            None => (0..count as u32).collect(),
        };
        if ends.iter().any(|&k| k as usize >= count) {
            return Err(Flaw::Index("a corner of a face"));
        }
        let surface = primitive.material().pbr_metallic_roughness();
        let set = surface.base_color_texture().map_or(0, |texture| texture.tex_coord());
        let first_place = self.raw.places.len() as u32;
        let places = match primitive.get(&Semantic::TexCoords(set)) {
            Some(accessor) if accessor.count() == count => self.buffers.numbers::<2>(&accessor)?,
            _ => Vec::new(),
        };
        // The format's coordinates begin at the upper left corner.
        self.raw.places.extend(places.iter().map(|[u, v]| Vec2::new(*u as f32, 1.0 - *v as f32)));
        if let Some(tint) = self.tint(primitive)? {
            let own = &self.looks[look].0;
            let tinted = Look { colour: own.colour * tint, ..own.clone() };
            look = self.looks.len();
            self.looks.push((tinted, false));
        }
        let look = u16::try_from(look).map_err(|_| Flaw::Unsupported("more than 65,536 materials".to_owned()))?;
        let first = self.corners as u32;
        let mut face = |corners: [u32; 3]| {
            let places = (!places.is_empty()).then(|| corners.map(|k| first_place + k));
            self.raw.faces.push(Face { corners: corners.map(|k| first + k), places, look });
        };
        for k in 0..triangles {
            let [a, b, c] = match mode {
                Mode::Triangles => [3 * k, 3 * k + 1, 3 * k + 2],
                Mode::TriangleFan => [0, k + 1, k + 2],
                // Every other one is the other way round.
                _ => [k, k + 1 + k % 2, k + 2 - k % 2],
            };
            face([ends[a], ends[b], ends[c]]);
        }
        self.corners += count;
        let shapes = self.buffers.shapes(primitive, count)?;
        let bonds = skin.map_or(Ok(Vec::new()), |(_, joints)| self.buffers.bonds(primitive, count, joints))?;
        Ok(Some(Part { node, skin: skin.map(|(skin, _)| skin), base, bonds, shapes }))
    }

    /// The mean of a primitive's colours of vertices: surfaces have one colour here, or a texture.
    fn tint(&self, primitive: &Primitive) -> Result<Option<Vec3>, Flaw> {
        let Some(accessor) = primitive.get(&Semantic::Colors(0)) else { return Ok(None) };
        let colours: Vec<[f64; 3]> = match accessor.dimensions() {
            gltf::accessor::Dimensions::Vec4 => {
                self.buffers.numbers::<4>(&accessor)?.into_iter().map(|[r, g, b, _]| [r, g, b]).collect()
            }
            _ => self.buffers.numbers(&accessor)?,
        };
        let mean = colours.iter().map(|colour| DVec3::from_array(*colour)).sum::<DVec3>() / colours.len().max(1) as f64;
        Ok(mean.is_finite().then(|| mean.clamp(DVec3::splat(0.02), DVec3::ONE).as_vec3()))
    }
}
