//! Things that move: rigid parts on joints, and parts that change their shape.

use std::sync::Arc;

use glam::{DAffine3, DQuat, DVec3};

use crate::cast::{Placed, Solid};
use crate::mesh::Mesh;
use crate::model::Model;
use crate::motion::{Joint, Motion, joint_poses};

/// One thing that moves, as a whole or in parts.
#[derive(Debug, Clone)]
pub(crate) struct Actor {
    pub(crate) motion: Motion,
    pub(crate) joints: Vec<Joint>,
    pub(crate) parts: Vec<Part>,
}

/// A mesh that hangs on a joint.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub(crate) solid: Arc<Solid>,
    /// A joint, or the root.
    pub(crate) joint: Option<usize>,
    pub(crate) change: Option<Change>,
}

/// What changes a part's shape.
#[derive(Debug, Clone)]
pub(crate) enum Change {
    Soft(Deform),
    Played(Played),
}

/// An animated model that plays a clip.
#[derive(Debug, Clone)]
pub(crate) struct Played {
    /// One with clips.
    pub(crate) model: Arc<Model>,
    pub(crate) clip: usize,
    /// Seconds of the clip a second, and its second at time 0.
    pub(crate) rate: f64,
    pub(crate) first: f64,
    /// From the model's axes to the part's.
    pub(crate) pose: DAffine3,
}

impl Change {
    /// The part's vertices at a time.
    fn positions(&self, mesh: &Mesh, t: f64) -> Vec<DVec3> {
        match self {
            Self::Soft(deform) => mesh.positions.iter().map(|&position| deform.point(position, t)).collect(),
            Self::Played(Played { model, clip, rate, first, pose }) => {
                let all = model.positions(*clip, first + rate * t);
                all.into_iter().map(|position| pose.transform_point3(position)).collect()
            }
        }
    }
}

/// A change of shape over time, in the part's own coordinates.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Deform {
    pub(crate) kind: DeformKind,
    /// How far: radians for bends and twists, parts of the size for pulses, metres for waves.
    pub(crate) by: f64,
    /// Radians a second.
    pub(crate) rate: f64,
    pub(crate) phase: f64,
    /// A length of the part: its height, or of a wave.
    pub(crate) size: f64,
}

/// What changes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum DeformKind {
    /// Leans over, the more the higher.
    Bend,
    /// Turns about z, the more the higher.
    Twist,
    /// Longer and thinner, shorter and thicker, at equal volume.
    Pulse,
    /// Waves along x that move y; held at x = 0.
    Wave,
    /// Bulges that travel over the surface.
    Wobble,
}

impl Deform {
    fn point(&self, p: DVec3, t: f64) -> DVec3 {
        let angle = self.rate * t + self.phase;
        match self.kind {
            DeformKind::Bend => {
                let lean = self.by * angle.sin() * p.z / self.size;
                DQuat::from_rotation_y(lean) * p
            }
            DeformKind::Twist => DQuat::from_rotation_z(self.by * angle.sin() * p.z / self.size) * p,
            DeformKind::Pulse => {
                let tall = 1.0 + self.by * angle.sin();
                let wide = 1.0 / tall.sqrt();
                p * DVec3::new(wide, wide, tall)
            }
            DeformKind::Wave => {
                let held = (p.x / self.size).clamp(0.0, 1.0);
                let wave = (p.x / self.size * 7.0 - angle).sin() + 0.5 * (p.z / self.size * 5.0 + angle * 1.3).sin();
                p + DVec3::new(-0.08 * self.by * held * wave.abs(), self.by * held * wave, 0.0)
            }
            DeformKind::Wobble => {
                let q = p * (4.0 / self.size);
                let wave = (q.x + angle).sin() + (q.y * 1.1 - angle * 0.8).sin() + (q.z * 0.9 + angle * 1.2).sin();
                p * (1.0 + self.by * wave / 3.0)
            }
        }
    }
}

impl Actor {
    /// One rigid mesh.
    pub(crate) fn rigid(solid: Arc<Solid>, motion: Motion) -> Self {
        Self { motion, joints: Vec::new(), parts: vec![Part { solid, joint: None, change: None }] }
    }

    /// About the middle of the actor at a time.
    pub(crate) fn middle(&self, t: f64) -> DVec3 {
        let root = self.motion.at(t);
        let local = self.motion.local_time(t);
        let joints = joint_poses(root, &self.joints, if local.is_finite() { local } else { t });
        let part = &self.parts[self.parts.len() / 2];
        let [low, high] = part.solid.mesh.bounds();
        part.joint.map_or(root, |joint| joints[joint]).transform_point3((low + high) / 2.0)
    }

    /// The parts at a time, in their order.
    pub(crate) fn at(&self, t: f64) -> Vec<Placed> {
        let root = self.motion.at(t);
        let local = self.motion.local_time(t);
        // A clock that always runs has no beginning.
        let local = if local.is_finite() { local } else { t };
        let joints = joint_poses(root, &self.joints, local);
        let place = |part: &Part| {
            let pose: DAffine3 = part.joint.map_or(root, |joint| joints[joint]);
            let solid = match &part.change {
                None => Arc::clone(&part.solid),
                Some(change) => {
                    let positions = change.positions(&part.solid.mesh, local);
                    Arc::new(Solid::new(Mesh { positions, ..part.solid.mesh.clone() }))
                }
            };
            Placed::new(solid, pose)
        };
        self.parts.iter().map(place).collect()
    }
}
