//! Things that scenes are furnished with. All functions return meshes that stand on z = 0, about the z axis, with materials of a
//! [`Kit`].

mod arena;
mod clutter;
mod figures;
mod furniture;
mod imported;
mod movers;
mod outdoor;
mod pieces;
mod walker;

use std::sync::Arc;

use crate::material::Material;
use crate::mesh::Mesh;
use crate::model::Model;
use crate::palette::Photos;

pub(crate) use arena::Arena;
pub(crate) use clutter::object;
pub(crate) use figures::figure;
pub(crate) use furniture::{Piece, bed, cabinet, chair, curtain, desk, lamp, picture, plant, rug, shelf, sofa, table};
pub(crate) use imported::hanging;
pub(crate) use movers::mover;
pub(crate) use outdoor::{bench, bush, car, house, lamp_post, tree};
pub(crate) use pieces::piece;
pub(crate) use walker::{animal, walker};

/// The materials of a scene while it is put together, and what it may take of imported models.
#[derive(Debug, Default)]
pub(crate) struct Kit {
    pub(crate) materials: Vec<Material>,
    pub(crate) photos: Photos,
    pub(crate) models: Vec<Arc<Model>>,
    /// Still models that the scene may take yet.
    pub(crate) left: usize,
    /// Triangles that models of the scene may have yet.
    pub(crate) triangles: usize,
    /// Part of the small things that are models; at 1, those that are left do not count.
    pub(crate) share: f64,
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
