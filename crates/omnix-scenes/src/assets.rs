//! What scenes take from a folder of the user's: photographs as textures, and models.
//!
//! Read are JPEG, PNG, WebP and BMP files, OBJ files with their MTL, glTF and GLB files, and libraries of models (`.sh3f` of Sweet Home 3D,
//! or any `.zip`), in the folder and the folders below it. A picture that a model's files name is a texture of it and no photograph.

pub(crate) mod store;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use rayon::prelude::*;

use self::store::{Store, ending};
use crate::error::ScenesError;
use crate::model::{CATALOGUE, Entry, Flaw, Model, entries};
use crate::photo::Photo;

/// Most pictures of a folder: they stay in memory, up to 4 MiB each.
const MOST_PICTURES: usize = 150;
/// Most models of a folder: they stay in memory.
const MOST_MODELS: usize = 200;
/// Most triangles of all models together: they take about 60 bytes each.
const MOST_TRIANGLES: usize = 4_000_000;
/// Models that are read side by side.
const AT_ONCE: usize = 16;
/// A catalogue, or a list of materials that is looked through for names of pictures, has fewer bytes than this.
const MOST_TEXT: u64 = 16 << 20;

/// Photographs and models. Cheap to clone: both are shared.
#[derive(Debug, Clone, Default)]
pub struct Assets {
    /// Photographs, in the order of their paths.
    pub photos: Vec<Arc<Photo>>,
    /// Models, in the order of their paths.
    pub models: Vec<Arc<Model>>,
    /// What was left out or mended, a line each: the file, and why.
    pub notes: Vec<String>,
}

/// A model that may be read: where it is, its name there, and what a catalogue says of it.
type Candidate<'a> = (&'a Store, String, Option<Entry>);

impl Assets {
    /// Reads a folder: at most 150 photographs and 200 models, evenly chosen from all. Models that cannot be used are left out with a
    /// note.
    ///
    /// # Errors
    /// A folder that cannot be read or holds neither photographs nor models, a photograph that cannot be used, and a folder of whose
    /// models none can be used and that has no photographs.
    pub fn read(folder: &Path) -> Result<Self, ScenesError> {
        let store = Store::folder(folder).map_err(|(path, source)| ScenesError::Read { path, source })?;
        let mut notes = Vec::new();
        let mut stores = Vec::new();
        for name in store.with_ending(&["sh3f", "zip"]) {
            match Store::archive(&store.path(name)) {
                Ok(archive) => stores.push(archive),
                Err(flaw) => notes.push(note(&store, name, &flaw.to_string())),
            }
        }
        let mut candidates: Vec<Candidate> = Vec::new();
        for archive in std::iter::once(&store).chain(&stores) {
            candidates.extend(of_store(archive, &mut notes));
        }
        let (models, first) = read_models(evenly(candidates, MOST_MODELS), &mut notes);

        let textures = textures(&store);
        let pictures = store.with_ending(&["jpg", "jpeg", "png", "webp", "bmp"]);
        let pictures: Vec<&str> = pictures.filter(|name| !textures.contains(*name)).collect();
        if pictures.is_empty() && models.is_empty() {
            if let Some((flaw, path)) = first {
                return Err(ScenesError::Model { flaw, path });
            }
            let reason = "it holds no JPEG, PNG, WebP or BMP, and no OBJ, glTF, GLB or library of models".to_owned();
            return Err(ScenesError::Texture { reason, path: folder.to_owned() });
        }
        let photos = evenly(pictures, MOST_PICTURES);
        let photos = photos
            .into_par_iter()
            .map(|name| Photo::read(&store.path(name)).map(Arc::new))
            .collect::<Result<_, _>>()?;
        Ok(Self { photos, models, notes })
    }

    /// What scenes depend on, for the digest of a job.
    pub(crate) fn identity(&self) -> serde_json::Value {
        let photos: Vec<[f32; 3]> = self.photos.iter().map(|photo| photo.mean().to_array()).collect();
        if self.models.is_empty() {
            return serde_json::json!(photos);
        }
        let models: Vec<String> = self.models.iter().map(|model| model.digest()).collect();
        serde_json::json!({ "photos": photos, "models": models })
    }
}

/// `count` entries of a list, or all of fewer, evenly chosen.
fn evenly<T>(list: Vec<T>, count: usize) -> Vec<T> {
    let (all, count) = (list.len(), list.len().min(count));
    let chosen: BTreeSet<usize> = (0..count).map(|k| k * all / count).collect();
    list.into_iter().enumerate().filter(|(k, _)| chosen.contains(k)).map(|(_, entry)| entry).collect()
}

fn note(store: &Store, name: &str, why: &str) -> String {
    format!("{}: {why}", store.path(name).display())
}

/// The models of a folder or library: those of its catalogue, else all files of a known kind.
fn of_store<'a>(store: &'a Store, notes: &mut Vec<String>) -> Vec<Candidate<'a>> {
    let Some(catalogue) = store.find("", CATALOGUE) else {
        let names = store.with_ending(&["obj", "gltf", "glb"]);
        return names.map(|name| (store, name.to_owned(), None)).collect();
    };
    let bytes = match store.read(catalogue, MOST_TEXT) {
        Ok(bytes) => bytes,
        Err(flaw) => {
            notes.push(note(store, catalogue, &flaw.to_string()));
            return Vec::new();
        }
    };
    // Properties files are in Latin-1: a byte is a letter.
    let text: String = bytes.iter().map(|&byte| char::from(byte)).collect();
    let (all, mut bad) = entries(&text);
    let mut found = Vec::new();
    for entry in all.into_iter().filter(|entry| !entry.built_in) {
        match store.find("", &entry.model) {
            Some(name) if ["obj", "gltf", "glb"].contains(&ending(name).as_str()) => {
                found.push((store, name.to_owned(), Some(entry)));
            }
            _ => bad += 1,
        }
    }
    if bad > 0 {
        notes.push(note(store, catalogue, &format!("{bad} left out: {}", Flaw::Catalogue)));
    }
    found
}

/// Reads models, side by side; and the first flaw.
fn read_models(
    candidates: Vec<Candidate>,
    notes: &mut Vec<String>,
) -> (Vec<Arc<Model>>, Option<(Flaw, std::path::PathBuf)>) {
    let read = |(store, name, entry): &Candidate| {
        let mut own = Vec::new();
        let model = Model::read(store, name, entry.as_ref(), &mut |why| own.push(note(store, name, &why)));
        (model, own)
    };
    let (mut models, mut first, mut triangles) = (Vec::new(), None, 0);
    // A few at once, since each may be large.
    for some in candidates.chunks(AT_ONCE) {
        let all: Vec<_> = some.par_iter().map(read).collect();
        for ((store, name, _), (model, own)) in some.iter().zip(all) {
            match model {
                Err(flaw) => {
                    notes.push(note(store, name, &format!("left out: {flaw}")));
                    first.get_or_insert((flaw, store.path(name)));
                }
                Ok(model) if triangles + model.triangles() > MOST_TRIANGLES => {
                    let why = format!("left out: all models together have more than {MOST_TRIANGLES} triangles");
                    notes.push(note(store, name, &why));
                }
                Ok(model) => {
                    notes.extend(own);
                    triangles += model.triangles();
                    models.push(Arc::new(model));
                }
            }
        }
    }
    (models, first)
}

/// The pictures that files of models in a folder name.
fn textures(store: &Store) -> BTreeSet<&str> {
    let mut found = BTreeSet::new();
    for name in store.with_ending(&["mtl", "gltf"]) {
        let Ok(bytes) = store.read(name, MOST_TEXT) else { continue };
        let text = String::from_utf8_lossy(&bytes);
        if ending(name) == "mtl" {
            let maps = text.lines().map(str::trim).filter(|line| line.starts_with("map_") || line.starts_with("bump"));
            for reference in maps.filter_map(|line| line.split_once(char::is_whitespace)) {
                let last = reference.1.split_whitespace().next_back().unwrap_or_default();
                found.extend(store.find(name, reference.1).or_else(|| store.find(name, last)));
            }
        } else if let Ok(json) = serde_json::from_str::<serde_json::Value>(&text) {
            let images = json["images"].as_array().into_iter().flatten();
            found.extend(images.filter_map(|image| store.find(name, image["uri"].as_str()?)));
        }
    }
    found
}
