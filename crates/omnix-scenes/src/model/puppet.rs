//! Models that move by themselves: nodes in a tree, skins, shapes to blend, and clips that drive them. f64 throughout.
//!
//! As glTF defines it: a node's pose is translation, rotation and scale after its parent's; a skinned vertex is where the weighted
//! mean of its joints puts it; a blended one is its base position with weighted offsets. Times are seconds from a clip's begin, and
//! clips repeat.

use glam::{DAffine3, DMat3, DQuat, DVec3, Vec3};

/// A node's pose relative to its parent.
#[derive(Debug, Clone)]
pub(crate) struct Node {
    /// An earlier node.
    pub(crate) parent: Option<usize>,
    pub(crate) translation: DVec3,
    pub(crate) rotation: DQuat,
    pub(crate) scale: DVec3,
    /// Of the shapes that its mesh blends.
    pub(crate) weights: Vec<f64>,
}

/// Joints and where their own coordinates are in those of the mesh.
#[derive(Debug, Clone)]
pub(crate) struct Skin {
    pub(crate) joints: Vec<usize>,
    pub(crate) inverse: Vec<DAffine3>,
}

/// Joints of a vertex, as indices of the skin's, and how much each counts.
pub(crate) type Bonds = ([u16; 4], [f32; 4]);

/// A range of vertices that hang on one node or one skin.
#[derive(Debug, Clone)]
pub(crate) struct Part {
    pub(crate) node: usize,
    pub(crate) skin: Option<usize>,
    pub(crate) base: Vec<DVec3>,
    /// One for each vertex where there is a skin.
    pub(crate) bonds: Vec<Bonds>,
    /// Offsets of all vertices, one list for each shape that is blended.
    pub(crate) shapes: Vec<Vec<Vec3>>,
}

/// What a channel of a clip drives.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Target {
    Translation,
    Rotation,
    Scale,
    Weights,
}

/// How values between two times are found.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Between {
    Step,
    Linear,
    /// Three values for each time: tangent in, value, tangent out.
    Cubic,
}

/// One changing property of one node.
#[derive(Debug, Clone)]
pub(crate) struct Channel {
    pub(crate) node: usize,
    pub(crate) target: Target,
    pub(crate) between: Between,
    /// Rising, at least one.
    pub(crate) times: Vec<f64>,
    /// `width` numbers for each value.
    pub(crate) values: Vec<f64>,
    pub(crate) width: usize,
}

/// An animation.
#[derive(Debug, Clone)]
pub(crate) struct Clip {
    pub(crate) seconds: f64,
    pub(crate) channels: Vec<Channel>,
}

/// A model with all that moves it.
#[derive(Debug, Clone, Default)]
pub(crate) struct Puppet {
    pub(crate) nodes: Vec<Node>,
    pub(crate) skins: Vec<Skin>,
    pub(crate) parts: Vec<Part>,
    pub(crate) clips: Vec<Clip>,
}

impl Puppet {
    /// Where all vertices are, part after part, in the file's world: at a time of a clip, or as the file has them.
    pub(crate) fn positions(&self, clip: Option<usize>, t: f64) -> Vec<DVec3> {
        let mut nodes = self.nodes.clone();
        if let Some(clip) = clip.and_then(|clip| self.clips.get(clip)) {
            let t = if clip.seconds > 0.0 { t.rem_euclid(clip.seconds) } else { 0.0 };
            clip.channels.iter().for_each(|channel| channel.set(&mut nodes[channel.node], t));
        }
        let mut poses: Vec<DAffine3> = Vec::with_capacity(nodes.len());
        for node in &nodes {
            let own = DAffine3::from_scale_rotation_translation(node.scale, node.rotation, node.translation);
            poses.push(node.parent.map_or(own, |parent| poses[parent] * own));
        }
        let place = |part: &Part| -> Vec<DVec3> {
            let weights = &nodes[part.node].weights;
            let shaped = |vertex: usize| {
                let offsets = part.shapes.iter().zip(weights).filter(|(_, weight)| **weight != 0.0);
                offsets.fold(part.base[vertex], |p, (shape, weight)| p + shape[vertex].as_dvec3() * *weight)
            };
            match part.skin.map(|skin| &self.skins[skin]) {
                None => (0..part.base.len()).map(|k| poses[part.node].transform_point3(shaped(k))).collect(),
                // The node's own pose does not count for what hangs on joints.
                Some(skin) => {
                    let joints: Vec<DAffine3> = skin
                        .joints
                        .iter()
                        .zip(&skin.inverse)
                        .map(|(&joint, inverse)| poses[joint] * *inverse)
                        .collect();
                    let bent = |(k, (bonds, weights)): (usize, &Bonds)| {
                        let p = shaped(k);
                        let pull = |j: usize| joints[usize::from(bonds[j])].transform_point3(p) * f64::from(weights[j]);
                        pull(0) + pull(1) + pull(2) + pull(3)
                    };
                    part.bonds.iter().enumerate().map(bent).collect()
                }
            }
        };
        self.parts.iter().flat_map(place).collect()
    }
}

impl Channel {
    fn set(&self, node: &mut Node, t: f64) {
        let value = self.at(t);
        match self.target {
            Target::Translation => node.translation = DVec3::new(value[0], value[1], value[2]),
            Target::Scale => node.scale = DVec3::new(value[0], value[1], value[2]),
            Target::Rotation => node.rotation = quaternion(&value),
            Target::Weights => node.weights = value,
        }
    }

    /// The value at a time; before the first and after the last, that one.
    fn at(&self, t: f64) -> Vec<f64> {
        let (width, last) = (self.width, self.times.len() - 1);
        let entry = |k: usize| &self.values[k * width..(k + 1) * width];
        let value = |k: usize| if self.between == Between::Cubic { entry(3 * k + 1) } else { entry(k) };
        let next = self.times.partition_point(|&time| time <= t);
        if next == 0 || next > last {
            return value(next.saturating_sub(1)).to_vec();
        }
        let (before, span) = (next - 1, self.times[next] - self.times[next - 1]);
        let s = (t - self.times[before]) / span;
        let (a, b) = (value(before), value(next));
        match self.between {
            Between::Step => a.to_vec(),
            Between::Linear if self.target == Target::Rotation => {
                quaternion(a).slerp(quaternion(b), s).to_array().to_vec()
            }
            Between::Linear => a.iter().zip(b).map(|(a, b)| a + (b - a) * s).collect(),
            Between::Cubic => {
                let (out, into) = (entry(3 * before + 2), entry(3 * next));
                let (s2, s3) = (s * s, s * s * s);
                let mix = |k: usize| {
                    a[k] * (2.0 * s3 - 3.0 * s2 + 1.0)
                        + out[k] * span * (s3 - 2.0 * s2 + s)
                        + b[k] * (3.0 * s2 - 2.0 * s3)
                        + into[k] * span * (s3 - s2)
                };
                (0..width).map(mix).collect()
            }
        }
    }
}

fn quaternion(value: &[f64]) -> DQuat {
    let q = DQuat::from_xyzw(value[0], value[1], value[2], value[3]);
    if q.length_squared() > 1e-12 { q.normalize() } else { DQuat::IDENTITY }
}

/// An affine map of a column-major 4 x 4 matrix, whose last row is not read.
pub(crate) fn affine(m: &[f64; 16]) -> DAffine3 {
    let column = |k: usize| DVec3::new(m[4 * k], m[4 * k + 1], m[4 * k + 2]);
    DAffine3 { matrix3: DMat3::from_cols(column(0), column(1), column(2)), translation: column(3) }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn channel(target: Target, between: Between, times: &[f64], values: &[f64], width: usize) -> Channel {
        Channel { node: 1, target, between, times: times.to_vec(), values: values.to_vec(), width }
    }

    #[test]
    fn values_between_times_are_as_the_format_says() {
        let at = |between, values: &[f64], t| channel(Target::Weights, between, &[1.0, 3.0], values, 1).at(t)[0];
        assert_eq!(at(Between::Step, &[5.0, 7.0], 2.9), 5.0);
        assert_eq!(at(Between::Linear, &[5.0, 7.0], 2.5), 6.5);
        assert_eq!((at(Between::Linear, &[5.0, 7.0], 0.0), at(Between::Linear, &[5.0, 7.0], 9.0)), (5.0, 7.0));
        // A line has its own slope as tangents.
        let line = [0.0, 5.0, 1.0, 1.0, 7.0, 0.0];
        assert!((at(Between::Cubic, &line, 1.5) - 5.5).abs() < 1e-12);
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let turn =
            channel(Target::Rotation, Between::Linear, &[0.0, 1.0], &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, half, half], 4);
        let expected = DQuat::from_rotation_z(std::f64::consts::FRAC_PI_4).to_array();
        assert!(turn.at(0.5).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12));
    }

    #[test]
    fn skins_bend_and_shapes_blend() {
        let node = |parent, translation| Node {
            parent,
            translation,
            rotation: DQuat::IDENTITY,
            scale: DVec3::ONE,
            weights: vec![0.5],
        };
        let turned = channel(Target::Translation, Between::Linear, &[0.0, 1.0], &[0.0, 1.0, 0.0, 4.0, 1.0, 0.0], 3);
        let puppet = Puppet {
            nodes: vec![node(None, DVec3::ZERO), node(Some(0), DVec3::Y)],
            skins: vec![Skin {
                joints: vec![0, 1],
                inverse: vec![DAffine3::IDENTITY, DAffine3::from_translation(-DVec3::Y)],
            }],
            parts: vec![
                Part {
                    node: 0,
                    skin: Some(0),
                    base: vec![DVec3::Y, DVec3::ZERO],
                    bonds: vec![([0, 1, 0, 0], [0.25, 0.75, 0.0, 0.0]), ([0, 0, 0, 0], [1.0, 0.0, 0.0, 0.0])],
                    shapes: Vec::new(),
                },
                Part { node: 1, skin: None, base: vec![DVec3::X], bonds: Vec::new(), shapes: vec![vec![Vec3::Z]] },
            ],
            clips: vec![Clip { seconds: 1.0, channels: vec![turned] }],
        };
        assert_eq!(puppet.positions(None, 0.0), [DVec3::Y, DVec3::ZERO, DVec3::new(1.0, 1.0, 0.5)]);
        // Three quarters of the second joint's way; clips repeat.
        let moved = puppet.positions(Some(0), 2.5);
        assert!(moved[0].distance(DVec3::new(1.5, 1.0, 0.0)) < 1e-12 && moved[1] == DVec3::ZERO, "{moved:?}");
        assert!(moved[2].distance(DVec3::new(3.0, 1.0, 0.5)) < 1e-12);
    }
}
