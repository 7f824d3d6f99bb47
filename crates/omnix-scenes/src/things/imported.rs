//! Imported models as things of a scene. Nothing is drawn from a stream of random numbers where there are no models.

use std::sync::Arc;

use glam::{DAffine3, DVec3, Vec3};

use crate::mesh::Mesh;
use crate::model::{Model, Stand};
use crate::palette;
use crate::random::Random;
use crate::things::Kit;

/// How much larger or smaller than asked for a model may be.
const NEAR: f64 = 1.7;

impl Kit {
    /// One of the models that fit, not larger than what the scene may still hold.
    pub(crate) fn pick(&mut self, random: &mut Random, fits: impl Fn(&Model) -> bool) -> Option<Arc<Model>> {
        // No single one takes more than half of what is left.
        let some = self.models.iter().filter(|model| model.triangles() * 2 <= self.triangles && fits(model));
        let some: Vec<Arc<Model>> = some.cloned().collect();
        if some.is_empty() {
            return None;
        }
        let model = Arc::clone(random.pick(&some));
        self.triangles -= model.triangles();
        Some(model)
    }

    /// The mesh of a model, scaled by a factor, with its materials. Some plain ones are made of something else.
    pub(crate) fn import(&mut self, random: &mut Random, model: &Model, factor: f64) -> Mesh {
        let changed = random.chance(0.25);
        let mut slots = Vec::with_capacity(model.looks.len());
        for look in &model.looks {
            let own = look.material(factor as f32);
            let other = changed && look.texture.is_none() && random.chance(0.6);
            let material = if other { palette::any(random, &self.photos) } else { own };
            slots.push(self.slot(material));
        }
        let mut mesh = model.mesh.clone().placed(DAffine3::from_scale(DVec3::splat(factor)));
        mesh.rest.iter_mut().for_each(|rest: &mut Vec3| *rest *= factor as f32);
        mesh.slots.iter_mut().for_each(|slot| *slot = slots[usize::from(*slot)]);
        mesh
    }
}

/// A model of about this height or width in metres in place of a made thing, by the kit's share.
pub(super) fn small(kit: &mut Kit, random: &mut Random, size: f64) -> Option<Mesh> {
    if kit.models.is_empty() || (kit.left == 0 && kit.share < 1.0) || !random.chance(kit.share) {
        return None;
    }
    let fits = |model: &Model| {
        let longest = model.size.max_element();
        model.stand == Stand::Floor
            && !model.is_animated()
            && (!model.known || (longest < size * NEAR && longest > size / NEAR))
    };
    let model = kit.pick(random, fits)?;
    if kit.share < 1.0 {
        kit.left -= 1;
    }
    let factor = if model.known { 1.0 } else { size };
    Some(kit.import(random, &model, factor))
}

/// A model that hangs: the mesh, its foot at z = 0 and its back at y = 0, its width, and its height above the floor; nothing for that where it
/// hangs under a ceiling.
pub(crate) fn hanging(kit: &mut Kit, random: &mut Random, ceiling: bool) -> Option<(Mesh, DVec3, f64)> {
    if kit.models.is_empty() || kit.left == 0 {
        return None;
    }
    let fits = |model: &Model| match model.stand {
        Stand::Wall(_) => !ceiling && model.size.x < 2.0 && model.size.y < 0.5,
        Stand::Ceiling => ceiling && model.size.z < 1.0,
        Stand::Floor => false,
    };
    let model = kit.pick(random, fits)?;
    kit.left -= 1;
    let height = if let Stand::Wall(height) = model.stand { height } else { 0.0 };
    let mesh = kit.import(random, &model, 1.0);
    Some((if ceiling { mesh } else { mesh.moved(DVec3::NEG_Y * model.size.y / 2.0) }, model.size, height))
}
