//! Imported models as pieces of furniture.

use glam::{DVec2, DVec3};

use crate::mesh::Mesh;
use crate::model::{Model, Stand};
use crate::random::Random;
use crate::things::Kit;
use crate::things::furniture::{Piece, Top};

/// How far from the height that a catalogue states a surface may be.
const LEVEL: f64 = 0.02;
/// Places at which a surface is tried, along each side.
const TRIES: usize = 7;

/// A model as a piece of furniture, not larger than `most` in width, depth and height, with the given probability.
pub(crate) fn piece(kit: &mut Kit, random: &mut Random, chance: f64, most: DVec3) -> Option<Piece> {
    if kit.models.is_empty() || kit.left == 0 || most.min_element() < 0.3 || !random.chance(chance) {
        return None;
    }
    // Small things stand on furniture, not along walls.
    let fits = |model: &Model| {
        let free = !model.known || (model.size.max_element() > 0.35 && model.size.cmple(most).all());
        free && model.stand == Stand::Floor && !model.is_animated()
    };
    let model = kit.pick(random, fits)?;
    kit.left -= 1;
    let factor = if model.known {
        1.0
    } else {
        // As large as furniture is, and as the place allows.
        let fit = (most / model.size.max(DVec3::splat(1e-3))).min_element();
        random.range(0.4, 1.6).min(fit)
    };
    let mesh = kit.import(random, &model, factor);
    let half = (model.size * factor / 2.0).truncate();
    let tops = model.top.and_then(|height| free_top(&mesh, half, height * factor)).into_iter().collect();
    Some(Piece { mesh, tops, half })
}

/// The part about the middle of a piece where its surface is at a height, if there is enough of it.
fn free_top(mesh: &Mesh, half: DVec2, height: f64) -> Option<Top> {
    let place = |k: usize| (k as f64 + 0.5) / TRIES as f64 * 2.0 - 1.0;
    [0.85, 0.5].into_iter().map(|part| half * part).find_map(|half| {
        let mut places = (0..TRIES * TRIES).map(|k| half * DVec2::new(place(k / TRIES), place(k % TRIES)));
        let level = |at: DVec2| surface(mesh, at).is_some_and(|z| (z - height).abs() < LEVEL);
        places.all(level).then_some(Top { centre: DVec3::Z * height, half: half * 0.9, room: 0.4 })
    })
}

/// The height of the uppermost surface above a place.
fn surface(mesh: &Mesh, at: DVec2) -> Option<f64> {
    let mut best: Option<f64> = None;
    for corners in &mesh.triangles {
        let [a, b, c] = corners.map(|corner| mesh.positions[corner as usize]);
        let [p, q, r] = [a, b, c].map(|corner| corner.truncate() - at);
        let weights = [q.perp_dot(r), r.perp_dot(p), p.perp_dot(q)];
        let sum: f64 = weights.iter().sum();
        if sum.abs() > 1e-15 && weights.iter().all(|weight| weight * sum >= 0.0) {
            let z = (a.z * weights[0] + b.z * weights[1] + c.z * weights[2]) / sum;
            best = Some(best.map_or(z, |most| most.max(z)));
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::shapes::cuboid;

    #[test]
    fn things_stand_only_where_a_surface_is() {
        let plate = cuboid(DVec3::new(2.0, 1.0, 0.1)).moved(DVec3::Z * 0.7);
        let half = DVec2::new(1.0, 0.5);
        let top = free_top(&plate, half, 0.75).unwrap();
        assert!((top.centre.z - 0.75).abs() < 1e-12 && top.half.x < 0.85);
        assert!(free_top(&plate, half, 0.6).is_none() && free_top(&plate, half * 3.0, 0.75).is_none());
        // A wall at one end leaves the middle free.
        let with_wall = Mesh::joined(&[plate, cuboid(DVec3::new(0.1, 1.0, 1.0)).moved(DVec3::new(0.7, 0.0, 1.0))]);
        assert!(free_top(&with_wall, half, 0.75).unwrap().half.x < 0.5);
    }
}
