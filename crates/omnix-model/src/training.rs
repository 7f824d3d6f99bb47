//! A whole network as one graph, for training: what inference does in five graphs, a few images at a time, is recorded over all images of
//! a sample, so that a gradient finds its way from every result to every parameter.
//!
//! Times of images are inputs here ([`TimeCode`]), since samples differ in them. The choices of the network (which tokens are
//! followed, which points move) pass their gradients straight through (`spec/omnix.md` 8.4).

use omnix_geometry::codes::time_codes;
use omnix_graph::graph::Source;
use omnix_graph::ops::{Gate, Motion, Sampling};
use omnix_graph::{Graph, GraphError, Value};

use crate::config::{MotionGate, SampledScore};
use crate::motion::MotionOutputs;
use crate::{BackboneSpec, Dropout, HeadSpec, ModelError, MotionSpec, Network, PATCH, SamplingSpec};

/// What a sample has.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingSpec {
    /// Images.
    pub images: usize,
    /// Patch rows and columns.
    pub grid: (usize, usize),
    /// Whether trajectories are wanted.
    pub motion: bool,
    /// Whether the points of trajectories are also wanted as they move without the gate.
    pub ungated: bool,
    /// Dropout where the network has it; `None` as in inference.
    pub dropout: Option<Dropout>,
    /// Whether the gate of trajectories is that of inference, for validation, where the network has another one in training.
    pub inference: bool,
}

/// A recorded network. S images of H × W pixels.
#[derive(Clone, Debug)]
pub struct TrainingOutputs {
    /// The input `images` `[S, 3, H, W]`, normalised.
    pub images: Value,
    /// Inputs that hold codes of the images' times, where the network has them.
    pub codes: Vec<TimeCode>,
    /// Camera codes `[S, 9]`.
    pub pose_codes: Value,
    /// `[S, H, W]`.
    pub depth: Value,
    /// `[S, H, W]`.
    pub depth_confidence: Value,
    /// `[S, 8gh, 8gw, 6]` and their confidence.
    pub rays: (Value, Value),
    /// `[S, H, W, 3]` in the world.
    pub points: Option<Value>,
    /// Trajectories.
    pub motion: Option<TrainingMotion>,
}

/// The part of a recorded network that moves.
#[derive(Clone, Copy, Debug)]
pub struct TrainingMotion {
    /// `[S · T, H · W, 3]`: source image, then target time; T = S.
    pub trajectories: Value,
    /// The same without the gate, where that is wanted.
    pub ungated: Option<Value>,
    /// `[S, H, W]`, the same for all times.
    pub confidence: Value,
    /// Motion score of every pixel, `[S, H · W]`.
    pub theta: Value,
    /// Probability of motion of every token, `[S, L]`.
    pub score: Value,
}

/// An input of codes of the images' times.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeCode {
    /// Name of the input, `[S, width]`.
    pub name: String,
    /// Channels.
    pub width: usize,
    /// Base of the frequencies.
    pub base: f64,
    /// Whether it codes the video; the frame otherwise.
    pub video: bool,
}

impl TimeCode {
    /// What the input holds for images of these (video, frame) times.
    #[must_use]
    pub fn of(&self, times: &[(u32, u32)]) -> Vec<f32> {
        let place = |(video, frame): &(u32, u32)| f64::from(if self.video { *video } else { *frame });
        time_codes(&times.iter().map(place).collect::<Vec<_>>(), self.width, self.base)
    }
}

impl Network {
    /// Records everything up to the results that losses compare, with no outputs declared.
    ///
    /// # Errors
    /// [`ModelError::Request`] when the network cannot do what is asked.
    pub fn training(&self, g: &mut Graph, spec: &TrainingSpec) -> Result<TrainingOutputs, ModelError> {
        let TrainingSpec { images, grid, motion, ungated, dropout, .. } = *spec;
        if self.config().metric.is_some() {
            let (what, name) = ("training of a nested network".to_owned(), &self.config().name);
            return Err(ModelError::Request {
                what,
                cure: format!("{name} is two networks; train its any-view network"),
            });
        }
        let times = vec![(0, 0); images];
        let reference = self.default_reference();
        let backbone = BackboneSpec {
            images,
            grid,
            reference,
            cameras_given: false,
            times: times.clone(),
            export_layers: Vec::new(),
        };
        let made = self.backbone(g, &backbone)?;
        let pose_codes = made.pose_codes.ok_or_else(|| self.lacks("cameras"))?;
        let head = self.head(g, &HeadSpec { frames: images, grid, rays: true, points: motion, gaussians: false })?;
        connect_all(g, &head.features, &made.features)?;
        if head.camera_rays.is_some() {
            let cure =
                format!("{} makes points by the predicted cameras; let them follow the rays", self.config().name);
            return Err(ModelError::Request { what: "training of trajectories".to_owned(), cure });
        }
        let rays = head.rays.ok_or_else(|| self.lacks("ray maps"))?;
        let moving = match head.points.filter(|_| motion) {
            Some(points) => {
                let module = self.motion_with(g, &MotionSpec { images, grid, times, forced: false }, dropout)?;
                // Networks that look at the last feature alone have one input.
                let first = made.features.len() - module.features.len();
                connect_all(g, &module.features, &made.features[first..])?;
                if let Some((input, tokens)) = module.point_tokens.zip(head.point_tokens) {
                    g.connect(input, tokens)?;
                }
                Some(self.moving(g, spec, &made.features, points, &module)?)
            }
            None if motion => return Err(self.lacks("world points")),
            None => None,
        };
        g.forget_outputs();
        let codes = self.free_codes(g);
        debug_assert!(moving.is_none_or(|m| m.ungated.is_some() == ungated), "BUG: ungated points");
        Ok(TrainingOutputs {
            images: made.images,
            codes,
            pose_codes,
            depth: head.depth,
            depth_confidence: head.confidence.ok_or_else(|| self.lacks("confidence"))?,
            rays,
            points: head.points,
            motion: moving,
        })
    }

    fn lacks(&self, what: &str) -> ModelError {
        let cure = format!("{} does not make them; train without", self.config().name);
        ModelError::Request { what: what.to_owned(), cure }
    }

    /// The sampling head over all images, and every image's trajectories.
    fn moving(
        &self,
        g: &mut Graph,
        spec: &TrainingSpec,
        features: &[Value],
        points: Value,
        module: &MotionOutputs,
    ) -> Result<TrainingMotion, ModelError> {
        let TrainingSpec { images, grid, ungated, inference, .. } = *spec;
        let config = self.config().trajectory.as_ref().ok_or_else(|| self.lacks("trajectories"))?;
        let mask = match config.sampled_score {
            SampledScore::Mask => g.straight_through(module.mask, module.score)?,
            SampledScore::Score => module.mask,
        };
        let sampling = self.sampling(g, &SamplingSpec { frames: images, times: images, grid })?;
        connect_all(g, &sampling.features, features)?;
        g.connect(sampling.field, module.field)?;
        g.connect(sampling.mask, mask)?;
        let gate = match config.gate {
            MotionGate::Hard { infer, train } => Gate::Hard(if inference { infer } else { train }),
            MotionGate::Blend => Gate::Blend,
        };
        let motion = Motion { gate, ..config.motion() };
        let free = Motion { gate: Gate::None, ..motion };
        let pixels = grid.0 * grid.1 * PATCH * PATCH;
        let (mut gated, mut open, mut thetas) = (Vec::new(), Vec::new(), Vec::new());
        for image in 0..images {
            let mut part = |value: Value, rest: &[usize]| -> Result<Value, GraphError> {
                let one = g.slice(value, 0, image, 1)?;
                g.reshape(one, rest)
            };
            let samples = config.samples();
            let of = Sampling {
                offsets: part(sampling.offsets, &[pixels, 2 * samples])?,
                weights: part(sampling.weights, &[pixels, samples])?,
                field: part(module.field, &[config.levels(), images, grid.0 * grid.1, crate::config::RIGID])?,
                mask: part(mask, &[grid.0 * grid.1])?,
                pixels: None,
                image: [grid.0 * PATCH, grid.1 * PATCH],
                grid: [grid.0, grid.1],
            };
            let world = part(points, &[pixels, 3])?;
            let tau = g.deform_sample(&of)?;
            // u32 in the bits of a constant.
            let when = g.constant("traj.when", [1], vec![f32::from_bits(image as u32)]);
            let (moved, theta) = g.traj_apply(tau, world, when, motion)?;
            gated.push(moved);
            thetas.push(g.reshape(theta, [1, pixels])?);
            if ungated {
                open.push(g.traj_apply(tau, world, when, free)?.0);
            }
        }
        Ok(TrainingMotion {
            trajectories: g.concat(&gated, 0)?,
            ungated: if ungated { Some(g.concat(&open, 0)?) } else { None },
            confidence: sampling.confidence,
            theta: g.concat(&thetas, 0)?,
            score: module.score,
        })
    }

    /// Makes the codes of times inputs.
    fn free_codes(&self, g: &mut Graph) -> Vec<TimeCode> {
        let config = self.config();
        let backbone = config.backbone.time.map(|time| ("backbone.time", config.backbone.width, time.base));
        let trajectory = config.trajectory.as_ref().map(|t| ("traj.time", t.width, t.time_base));
        let mut codes = Vec::new();
        for (at, width, base) in backbone.into_iter().chain(trajectory) {
            for (kind, video) in [("video", true), ("frame", false)] {
                let name = format!("{at}.{kind}.code");
                let found = g.find(&name).filter(|value| matches!(g.info(*value).source, Source::Constant(_)));
                if let Some(value) = found {
                    g.free_constant(value);
                    codes.push(TimeCode { name, width, base, video });
                }
            }
        }
        codes
    }
}

/// Makes every input the value that it stands for.
fn connect_all(g: &mut Graph, inputs: &[Value], values: &[Value]) -> Result<(), GraphError> {
    inputs.iter().zip(values).try_for_each(|(input, value)| g.connect(*input, *value))
}
