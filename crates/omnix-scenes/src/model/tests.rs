//! Models of files that the tests write, each bad one once.

mod gltf;
mod obj;
pub(crate) mod samples;

use std::path::Path;

use super::{Flaw, Model};
use crate::assets::store::Store;

/// The model of a file in a folder, and what was told of it.
fn read(folder: &Path, name: &str) -> (Result<Model, Flaw>, Vec<String>) {
    let store = Store::folder(folder).unwrap();
    let mut notes = Vec::new();
    let model = Model::read(&store, name, None, &mut |note| notes.push(note));
    (model, notes)
}
