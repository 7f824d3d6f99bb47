//! Things that scenes are furnished with. All functions return meshes that stand on z = 0, about the z axis, with materials of a
//! [`Kit`].

mod clutter;
mod furniture;
mod movers;
mod outdoor;
mod walker;

use crate::material::Material;
use crate::mesh::Mesh;
use crate::palette::Photos;

pub(crate) use clutter::object;
pub(crate) use furniture::{Piece, bed, cabinet, chair, curtain, desk, lamp, picture, plant, rug, shelf, sofa, table};
pub(crate) use movers::{Arena, mover};
pub(crate) use outdoor::{bench, bush, car, house, lamp_post, tree};
pub(crate) use walker::{animal, walker};

/// The materials of a scene while it is put together.
#[derive(Debug, Default)]
pub(crate) struct Kit {
    pub(crate) materials: Vec<Material>,
    pub(crate) photos: Photos,
}

impl Kit {
    /// A new material's slot.
    pub(crate) fn slot(&mut self, material: Material) -> u16 {
        // Scenes have hundreds of materials; one with 65,536 would share its last.
        let slot = self.materials.len().min(usize::from(u16::MAX));
        if slot == self.materials.len() {
            self.materials.push(material);
        }
        slot as u16
    }

    /// A mesh in a new material.
    pub(crate) fn made(&mut self, mesh: Mesh, material: Material) -> Mesh {
        let slot = self.slot(material);
        mesh.with(slot)
    }
}
