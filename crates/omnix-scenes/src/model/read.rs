//! One model as scenes use it: z up, its front towards -y, standing on z = 0 about the z axis.

use glam::{DAffine3, DMat3, DVec3};

use super::catalogue::Entry;
use super::flaw::Flaw;
use super::gltf::read_gltf;
use super::obj::read_obj;
use super::puppet::Puppet;
use super::raw::{Look, Raw};
use crate::assets::store::{Store, ending};
use crate::mesh::{Mesh, bounds};

/// A model with more triangles than this is not animated: its hierarchy is built again at each time.
const MOST_ANIMATED: usize = 100_000;
/// Times of a clip at which it is measured.
const LOOKS: usize = 8;
/// Sides in metres that a glTF file is believed to have.
const BELIEVED: [f64; 2] = [0.02, 6.0];

/// Where a model can stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Stand {
    /// On a floor, or on furniture where it is small.
    Floor,
    /// On a wall, its foot this high above the floor.
    Wall(f64),
    /// Under a ceiling.
    Ceiling,
}

/// A model of a file: a piece of furniture, a thing, a figure that moves.
#[derive(Debug)]
pub struct Model {
    name: String,
    /// In metres, or with 1 as its longest side where its size is not known. Slots are indices of `looks`.
    pub(crate) mesh: Mesh,
    pub(crate) looks: Vec<Look>,
    /// Width, depth and height of the mesh.
    pub(crate) size: DVec3,
    /// Whether the mesh is in metres.
    pub(crate) known: bool,
    pub(crate) stand: Stand,
    /// Height at which things can stand on it.
    pub(crate) top: Option<f64>,
    play: Option<Play>,
    digest: blake3::Hash,
}

/// How a model moves by itself.
#[derive(Debug)]
struct Play {
    puppet: Puppet,
    /// For each vertex of the mesh, the puppet's vertex that it was made of.
    sources: Vec<u32>,
    /// From the file's axes to the model's.
    axes: DAffine3,
}

impl Play {
    fn positions(&self, clip: usize, t: f64) -> Vec<DVec3> {
        let all = self.puppet.positions(Some(clip), t);
        self.sources.iter().map(|&source| self.axes.transform_point3(all[source as usize])).collect()
    }
}

impl Model {
    /// Reads an OBJ, glTF or GLB file. With an entry of a catalogue the model is as large as that says.
    pub(crate) fn read(
        store: &Store,
        name: &str,
        entry: Option<&Entry>,
        note: &mut dyn FnMut(String),
    ) -> Result<Self, Flaw> {
        let (raw, puppet, crease) = if ending(name) == "obj" {
            // Files of this kind seldom say well which edges are sharp.
            (read_obj(store, name, note)?, None, 0.7)
        } else {
            let (raw, puppet) = read_gltf(store, name, note)?;
            (raw, Some(puppet).filter(|puppet| !puppet.clips.is_empty()), -0.2)
        };
        let metric = ending(name) != "obj";
        Self::of(raw, puppet, crease, metric, entry, store.path(name).to_string_lossy().into_owned(), note)
    }

    fn of(
        raw: Raw,
        puppet: Option<Puppet>,
        crease: f64,
        metric: bool,
        entry: Option<&Entry>,
        name: String,
        note: &mut dyn FnMut(String),
    ) -> Result<Self, Flaw> {
        let mut raw = raw.checked()?;
        let puppet = puppet.filter(|_| {
            let few = raw.faces.len() <= MOST_ANIMATED;
            if !few {
                note(format!("it has more than {MOST_ANIMATED} triangles, so its animation is not played"));
            }
            few
        });
        // Where the model is while its first clip plays; positions of a file may hold more than its faces use.
        let mut points: Vec<DVec3> = Vec::new();
        for corner in raw.faces.iter().flat_map(|face| face.corners) {
            points.push(raw.positions[corner as usize]);
        }
        let clips = puppet.as_ref().map_or(&[][..], |puppet| &puppet.clips[..]);
        for (clip, k) in (0..clips.len().min(LOOKS)).flat_map(|clip| (0..LOOKS).map(move |k| (clip, k))) {
            let t = clips[clip].seconds * k as f64 / LOOKS as f64;
            points.extend(puppet.iter().flat_map(|puppet| puppet.positions(Some(clip), t)));
        }
        if !points.iter().all(|point| point.is_finite()) {
            return Err(Flaw::NotFinite("a position while it moves"));
        }
        // From y up and the front towards z to z up and the front towards -y.
        let upright = DMat3::from_cols(DVec3::X, DVec3::Z, DVec3::NEG_Y);
        let turn = upright * entry.map_or(DMat3::IDENTITY, |entry| entry.rotation);
        for point in &mut points {
            *point = turn * *point;
        }
        let [low, high] = bounds(&points);
        let found = high - low;
        let longest = found.max_element();
        let believed = metric && (BELIEVED[0]..=BELIEVED[1]).contains(&longest);
        let scale = match entry {
            // A flat side stays flat.
            Some(entry) => entry.size / found.max(DVec3::splat(longest * 1e-6)),
            None if believed => DVec3::ONE,
            None => DVec3::splat(1.0 / longest),
        };
        let middle = ((low + high) / 2.0).with_z(low.z);
        let axes = DAffine3::from_scale(scale) * DAffine3::from_translation(-middle) * DAffine3::from_mat3(turn);
        for position in &mut raw.positions {
            *position = axes.transform_point3(*position);
        }
        let raw = raw.measured();
        let (mesh, sources) = raw.mesh(crease);
        let stand = match entry {
            Some(entry) if entry.light && entry.elevation > 1.6 => Stand::Ceiling,
            Some(entry) if entry.elevation > 0.25 => Stand::Wall(entry.elevation),
            _ => Stand::Floor,
        };
        let mut model = Self {
            name,
            mesh,
            looks: raw.looks,
            size: found * scale,
            known: entry.is_some() || believed,
            stand,
            top: entry.and_then(|entry| entry.top),
            play: puppet.map(|puppet| Play { puppet, sources, axes }),
            digest: blake3::hash(&[]),
        };
        model.digest = model.hash();
        Ok(model)
    }

    /// The file it was read from.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Number of its triangles.
    #[must_use]
    pub fn triangles(&self) -> usize {
        self.mesh.triangles.len()
    }

    /// Its vertices at a time of a clip, in seconds; clips repeat. Those of the mesh where it has no clips.
    pub(crate) fn positions(&self, clip: usize, t: f64) -> Vec<DVec3> {
        self.play.as_ref().map_or_else(|| self.mesh.positions.clone(), |play| play.positions(clip, t))
    }

    /// Number of its clips.
    pub(crate) fn clips(&self) -> usize {
        self.play.as_ref().map_or(0, |play| play.puppet.clips.len())
    }

    /// Whether it moves by itself: a skin, shapes that blend, or parts that a clip drives.
    #[must_use]
    pub const fn is_animated(&self) -> bool {
        self.play.is_some()
    }

    /// BLAKE3 of what scenes take from it, in hexadecimal digits; not of its name.
    #[must_use]
    pub fn digest(&self) -> String {
        self.digest.to_hex().to_string()
    }

    fn hash(&self) -> blake3::Hash {
        let mut hasher = blake3::Hasher::new();
        let mut put = |points: &[DVec3]| {
            points.iter().flat_map(|p| p.to_array()).for_each(|v| _ = hasher.update(&v.to_le_bytes()));
        };
        put(&self.mesh.positions);
        for (play, clip) in self.play.iter().flat_map(|play| (0..play.puppet.clips.len()).map(move |clip| (play, clip)))
        {
            // A time that no clip has a key at.
            put(&play.positions(clip, 0.123_456_7 * play.puppet.clips[clip].seconds));
        }
        for (corners, slot) in self.mesh.triangles.iter().zip(&self.mesh.slots) {
            corners.iter().for_each(|corner| _ = hasher.update(&corner.to_le_bytes()));
            hasher.update(&slot.to_le_bytes());
        }
        for look in &self.looks {
            let texture = look.texture.as_ref().map_or(glam::Vec3::NEG_ONE, |photo| photo.mean());
            let numbers = [look.colour.to_array(), texture.to_array(), [look.gloss, look.rough, look.unit]];
            numbers.as_flattened().iter().for_each(|v| _ = hasher.update(&v.to_le_bytes()));
        }
        hasher.finalize()
    }
}
