//! The textures of one model, each read once.

use std::collections::HashMap;
use std::sync::Arc;

use super::flaw::Flaw;
use crate::assets::store::Store;
use crate::photo::Photo;

/// Longest side of a model's texture: there may be hundreds of them.
const LONGEST: u32 = 256;
/// A picture has fewer bytes than this.
const MOST_BYTES: u64 = 64 << 20;
/// A texture with more transparent pixels than this part has holes.
const HOLES: f64 = 0.02;

/// Textures by the references of a file.
pub(crate) struct Textures<'a> {
    store: &'a Store,
    /// The file that refers to them.
    name: &'a str,
    known: HashMap<String, Option<Arc<Photo>>>,
}

impl<'a> Textures<'a> {
    pub(crate) fn new(store: &'a Store, name: &'a str) -> Self {
        Self { store, name, known: HashMap::new() }
    }

    /// The texture of a reference; nothing where it is missing or broken.
    pub(crate) fn get(&mut self, reference: &str) -> Result<Option<Arc<Photo>>, Flaw> {
        if let Some(known) = self.known.get(reference) {
            return Ok(known.clone());
        }
        let bytes = self.store.find(self.name, reference).and_then(|file| self.store.read(file, MOST_BYTES).ok());
        let photo = bytes.map_or(Ok(None), |bytes| decoded(&bytes, false))?;
        self.known.insert(reference.to_owned(), photo.clone());
        Ok(photo)
    }
}

/// A picture in memory as a texture; nothing where it is broken. One with holes is refused, unless it is said to be solid.
pub(crate) fn decoded(bytes: &[u8], solid: bool) -> Result<Option<Arc<Photo>>, Flaw> {
    match Photo::of_bytes(bytes, LONGEST) {
        Ok((_, clear)) if clear > HOLES && !solid => Err(Flaw::SeeThrough),
        Ok((photo, _)) => Ok(Some(Arc::new(photo))),
        Err(_) => Ok(None),
    }
}
