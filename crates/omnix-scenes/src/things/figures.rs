//! Imported models that move by themselves: skinned figures, shapes that blend, machines that a clip drives.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};

use crate::actor::{Actor, Change, Part, Played};
use crate::cast::Solid;
use crate::model::Model;
use crate::motion::Turn;
use crate::random::Random;
use crate::things::{Arena, Kit};

/// A figure that plays one of its clips, walking or in its place. `None` where no asset is a figure, or where another kind of thing is drawn.
pub(crate) fn figure(kit: &mut Kit, random: &mut Random, arena: &Arena) -> Option<Actor> {
    // Beside things that move as a whole.
    if !random.chance(0.7) {
        return None;
    }
    let model = kit.pick(random, Model::is_animated)?;
    let longest = model.size.max_element();
    let fits = model.known
        && model.size.z < arena.tall * 1.4
        && longest > 0.04 * arena.width()
        && longest < 1.5 * arena.width();
    let factor = if fits { 1.0 } else { (arena.size(random) * 1.5).min(arena.tall) / longest };
    let mesh = kit.import(random, &model, factor);
    let walks = random.chance(0.5);
    let speed = if walks { random.range(0.2, 0.8) * model.size.z * factor } else { 0.0 };
    let mut motion = arena.strolling(random, speed);
    // Figures look towards -y, things that go look along x.
    let ahead = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_2);
    if let Turn::Fixed(turn) = &mut motion.turn {
        *turn = DQuat::from_rotation_z(random.range(0.0, 6.3));
    }
    let clip = random.below(model.clips());
    let pose = DAffine3::from_scale_rotation_translation(DVec3::splat(factor), ahead, DVec3::ZERO);
    let (rate, first) = (random.range(0.7, 1.3), random.range(0.0, 10.0));
    // The vertices come from the clip at every time.
    let solid = Arc::new(Solid::new(mesh.rotated(ahead)));
    let change = Some(Change::Played(Played { model, clip, rate, first, pose }));
    Some(Actor { motion, joints: Vec::new(), parts: vec![Part { solid, joint: None, change }] })
}
