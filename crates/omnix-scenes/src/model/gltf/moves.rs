//! What moves in a glTF file: nodes, skins, shapes to blend, clips.

use glam::{DQuat, DVec3, Vec3};
use gltf::animation::{Interpolation, Property};
use gltf::{Gltf, Primitive, Semantic};

use super::numbers::Buffers;
use crate::model::flaw::Flaw;
use crate::model::puppet::{Between, Bonds, Channel, Clip, Node, Skin, Target, affine};

/// Offsets of all shapes of a primitive together are fewer than this.
const MOST_OFFSETS: usize = 20_000_000;

/// All nodes, each after its parent, and the place of each of the file's nodes among them.
pub(super) fn nodes(file: &Gltf) -> Result<(Vec<Node>, Vec<usize>), Flaw> {
    let count = file.nodes().count();
    let mut parents: Vec<Option<usize>> = vec![None; count];
    for node in file.nodes() {
        for child in node.children() {
            if parents[child.index()].replace(node.index()).is_some() {
                return Err(Flaw::Broken("a node has two parents".to_owned()));
            }
        }
    }
    let mut children = vec![Vec::new(); count];
    let mut waiting = Vec::new();
    for (node, parent) in parents.iter().enumerate().rev() {
        match parent {
            Some(parent) => children[*parent].push(node),
            None => waiting.push(node),
        }
    }
    let all: Vec<gltf::Node> = file.nodes().collect();
    let (mut nodes, mut order) = (Vec::with_capacity(count), vec![usize::MAX; count]);
    while let Some(index) = waiting.pop() {
        waiting.extend(&children[index]);
        order[index] = nodes.len();
        let node = &all[index];
        let (translation, rotation, scale) = node.transform().decomposed();
        let weights = node.weights().or_else(|| node.mesh()?.weights()).unwrap_or_default();
        let wide = |v: [f32; 3]| DVec3::from_array(v.map(f64::from));
        let rotation = DQuat::from_array(rotation.map(f64::from));
        let made = Node {
            parent: parents[index].map(|parent| order[parent]),
            translation: wide(translation),
            rotation: if rotation.length_squared() > 1e-12 { rotation.normalize() } else { DQuat::IDENTITY },
            scale: wide(scale),
            weights: weights.iter().map(|&weight| f64::from(weight)).collect(),
        };
        if !(made.translation.is_finite() && made.rotation.is_finite() && made.scale.is_finite()) {
            return Err(Flaw::NotFinite("a node"));
        }
        nodes.push(made);
    }
    // Those in a circle have no root.
    if order.contains(&usize::MAX) {
        Err(Flaw::Broken("its nodes are in a circle".to_owned()))
    } else {
        Ok((nodes, order))
    }
}

pub(super) fn skins(file: &Gltf, buffers: &Buffers, order: &[usize]) -> Result<Vec<Skin>, Flaw> {
    let skin = |skin: gltf::Skin| {
        let joints: Vec<usize> = skin.joints().map(|joint| order[joint.index()]).collect();
        if joints.is_empty() {
            return Err(Flaw::NoJoints);
        }
        let inverse = match skin.inverse_bind_matrices() {
            Some(accessor) => buffers.numbers::<16>(&accessor)?.iter().map(affine).collect(),
            None => vec![glam::DAffine3::IDENTITY; joints.len()],
        };
        if inverse.len() < joints.len() {
            return Err(Flaw::Index("a matrix of a skin"));
        }
        if inverse.iter().any(|matrix| !matrix.is_finite()) {
            return Err(Flaw::NotFinite("a skin"));
        }
        Ok(Skin { joints, inverse })
    };
    file.skins().map(skin).collect()
}

impl Buffers {
    /// Joints and weights of a primitive's vertices.
    pub(super) fn bonds(&self, primitive: &Primitive, count: usize, joints: usize) -> Result<Vec<Bonds>, Flaw> {
        let (Some(own), Some(weights)) = (primitive.get(&Semantic::Joints(0)), primitive.get(&Semantic::Weights(0)))
        else {
            return Err(Flaw::NoJoints);
        };
        let (own, weights) = (self.numbers::<4>(&own)?, self.numbers::<4>(&weights)?);
        if own.len() != count || weights.len() != count {
            return Err(Flaw::Index("a joint of a vertex"));
        }
        let bond = |(own, weights): (&[f64; 4], &[f64; 4])| {
            let sum: f64 = weights.iter().sum();
            if !sum.is_finite() {
                return Err(Flaw::NotFinite("a weight of a joint"));
            }
            if own.iter().zip(weights).any(|(&joint, &weight)| weight != 0.0 && joint as usize >= joints) {
                return Err(Flaw::Index("a joint of a vertex"));
            }
            // What hangs on nothing hangs on the first joint.
            let weights = if sum > 1e-6 { weights.map(|weight| (weight / sum) as f32) } else { [1.0, 0.0, 0.0, 0.0] };
            Ok((own.map(|joint| (joint as usize).min(joints - 1) as u16), weights))
        };
        own.iter().zip(&weights).map(bond).collect()
    }

    /// The offsets of a primitive's vertices, for each shape that can be blended.
    pub(super) fn shapes(&self, primitive: &Primitive, count: usize) -> Result<Vec<Vec<Vec3>>, Flaw> {
        if primitive.morph_targets().count().saturating_mul(count) > MOST_OFFSETS {
            return Err(Flaw::Unsupported(format!("more than {MOST_OFFSETS} offsets of shapes to blend")));
        }
        let offsets = |shape: gltf::mesh::MorphTarget| {
            let Some(accessor) = shape.positions() else { return Ok(vec![Vec3::ZERO; count]) };
            let offsets = self.numbers::<3>(&accessor)?;
            let offsets: Vec<Vec3> = offsets.into_iter().map(|o| Vec3::from_array(o.map(|v| v as f32))).collect();
            if offsets.len() != count {
                return Err(Flaw::Index("an offset of a shape"));
            }
            if offsets.iter().all(|offset| offset.is_finite()) { Ok(offsets) } else { Err(Flaw::NotFinite("a shape")) }
        };
        primitive.morph_targets().map(offsets).collect()
    }
}

/// The animations that drive anything.
pub(super) fn clips(file: &Gltf, buffers: &Buffers, order: &[usize]) -> Result<Vec<Clip>, Flaw> {
    let mut clips = Vec::new();
    for animation in file.animations() {
        let mut channels = Vec::new();
        for channel in animation.channels() {
            channels.push(self::channel(&channel, buffers, order)?);
        }
        let seconds =
            channels.iter().filter_map(|channel: &Channel| channel.times.last()).fold(0.0, |a, &b| f64::max(a, b));
        // What lasts no time does not move.
        if seconds > 0.0 {
            clips.push(Clip { seconds, channels });
        }
    }
    Ok(clips)
}

fn channel(channel: &gltf::animation::Channel, buffers: &Buffers, order: &[usize]) -> Result<Channel, Flaw> {
    let sampler = channel.sampler();
    let times: Vec<f64> = buffers.numbers::<1>(&sampler.input())?.into_iter().map(|[t]| t).collect();
    let between = match sampler.interpolation() {
        Interpolation::Step => Between::Step,
        Interpolation::Linear => Between::Linear,
        Interpolation::CubicSpline => Between::Cubic,
    };
    let output = sampler.output();
    let (target, values, width) = match channel.target().property() {
        Property::Translation => (Target::Translation, buffers.numbers::<3>(&output)?.into_flattened(), 3),
        Property::Scale => (Target::Scale, buffers.numbers::<3>(&output)?.into_flattened(), 3),
        Property::Rotation => (Target::Rotation, buffers.numbers::<4>(&output)?.into_flattened(), 4),
        Property::MorphTargetWeights => {
            let mesh = channel.target().node().mesh();
            let shapes = mesh.and_then(|mesh| mesh.primitives().next()).map_or(0, |p| p.morph_targets().count());
            (Target::Weights, buffers.numbers::<1>(&output)?.into_flattened(), shapes)
        }
    };
    let entries = times.len() * if between == Between::Cubic { 3 } else { 1 };
    if times.is_empty() || width == 0 || values.len() < entries.saturating_mul(width) {
        return Err(Flaw::Index("a value of an animation"));
    }
    let rises = times.windows(2).all(|pair| pair[0] < pair[1]);
    if !rises || !times.iter().chain(&values).all(|v| v.is_finite()) {
        return Err(Flaw::NotFinite("an animation"));
    }
    Ok(Channel { node: order[channel.target().node().index()], target, between, times, values, width })
}
