//! The trajectory module on the device: tokens, field, sampling, points that move, against what was recorded of them.
//!
//! The recorded stream `traj.z…` has the source image first, ours the target time; heads' maps were recorded of image 0.
//! What a threshold decides is compared where rounding cannot turn the decision: `out.trajectory` where θ is not within
//! 1e-3 of the gate, `moved` where θ is above it (below, a matrix under the norm floor amplifies rounding).

use std::ops::ControlFlow;

use omnix::WeightType;
use omnix::Weights;
use omnix::graph::ops::{Gate, Motion, Sampling};
use omnix::graph::{Executable, Graph};
use omnix::model::config::TrajectoryConfig;
use omnix::model::{MotionSpec, SamplingSpec, TrajectorySpec, trajectory};

use crate::case::{Case, Tensor};
use crate::ready::{Report, prepare};

/// Distance from the gate within which θ says nothing.
const UNDECIDED: f32 = 1e-3;

/// Read off the field at places that the network computes, up to several cells away: half-precision weights move the places by
/// 1e-3, and the field jumps from a chosen cell to its neighbour, so that these get twice the bound of the others. Not in
/// f32, nor do the trajectories themselves need it.
pub(crate) const SAMPLED: [&str; 2] = ["tau", "out.pixel_score"];

/// What all stages share.
struct Stages<'a> {
    weights: &'a Weights,
    config: &'a TrajectoryConfig,
    case: &'a Case,
    storage: WeightType,
    images: usize,
    grid: (usize, usize),
}

/// Where the points and features of the earlier stages are.
pub(crate) struct Before<'a> {
    pub(crate) backbone: &'a Executable,
    pub(crate) head: &'a Executable,
    pub(crate) times: Vec<(u32, u32)>,
    pub(crate) grid: (usize, usize),
}

/// Runs and compares the module if the network has one and the case recorded it.
pub(crate) fn run(
    weights: &Weights,
    case: &Case,
    storage: WeightType,
    before: &Before<'_>,
    report: Report<'_>,
) -> Result<(), String> {
    let Some(config) = &weights.network().config().trajectory else { return Ok(()) };
    let images = before.times.len();
    let stages = Stages { weights, config, case, storage, images, grid: before.grid };
    let motion = stages.motion(before, report)?;
    let sampling = stages.sampling(before, &motion, report)?;
    stages.points(before, &motion, &sampling, report)
}

fn text(error: impl std::fmt::Display) -> String {
    error.to_string()
}

impl Stages<'_> {
    /// Recorded tensors by the beginning of their names.
    fn recorded(&self, starts: &[&str]) -> Vec<(&str, &Tensor)> {
        let all = self.case.tensors.iter().map(|(name, tensor)| (name.as_str(), tensor));
        all.filter(|(name, _)| starts.iter().any(|s| name.starts_with(s))).collect()
    }

    fn cells(&self) -> usize {
        self.grid.0 * self.grid.1
    }

    fn pixels(&self) -> usize {
        self.cells() * 14 * 14
    }

    fn ready(&self, graph: &Graph, inputs: &[(&str, Vec<f32>)]) -> Result<Executable, String> {
        let ready = prepare(self.weights, graph, self.storage).map_err(text)?;
        for (name, data) in inputs {
            ready.write(name, data).map_err(text)?;
        }
        ready.run(&mut |_, _| ControlFlow::Continue(())).map_err(text)?;
        Ok(ready)
    }

    fn motion(&self, before: &Before<'_>, report: Report<'_>) -> Result<Executable, String> {
        let recorded = self.recorded(&["traj.", "out.token_score"]);
        let mut graph = Graph::with_taps(recorded.iter().map(|(name, _)| (*name).to_owned()));
        let spec = MotionSpec { images: self.images, grid: self.grid, times: before.times.clone(), forced: false };
        let outputs = self.weights.network().motion(&mut graph, &spec).map_err(text)?;
        let mut inputs = Vec::new();
        for feature in outputs.features {
            let name = graph.value_name(feature).to_owned();
            let data = before.backbone.read(&name).map_err(text)?;
            inputs.push((name, data));
        }
        if outputs.point_tokens.is_some() {
            inputs.push(("traj.point_tokens".to_owned(), before.head.read("traj.point_tokens").map_err(text)?));
        }
        let inputs: Vec<(&str, Vec<f32>)> = inputs.iter().map(|(n, d)| (n.as_str(), d.clone())).collect();
        let motion = self.ready(&graph, &inputs)?;
        for (name, tensor) in recorded {
            let got = match name {
                "traj.index" => motion.read_indices(name).map_err(text)?.into_iter().map(|i| i as f32).collect(),
                "traj.mask" => motion.read("mask").map_err(text)?,
                "out.token_score" => motion.read("traj.score").map_err(text)?,
                _ => motion.read(name).map_err(|e| format!("{name}: {e}"))?,
            };
            let source_first = name.strip_prefix("traj.z").is_some_and(|n| n.parse::<usize>().is_ok());
            let got = if source_first { transposed(&got, self.images) } else { got };
            report(name, &got, &tensor.data);
        }
        Ok(motion)
    }

    fn sampling(&self, before: &Before<'_>, motion: &Executable, report: Report<'_>) -> Result<Executable, String> {
        let recorded = self.recorded(&["head.", "out.trajectory_conf"]);
        let mut graph = Graph::with_taps(recorded.iter().map(|(name, _)| (*name).to_owned()));
        let spec = SamplingSpec { frames: self.images, times: self.images, grid: self.grid };
        self.weights.network().sampling(&mut graph, &spec).map_err(text)?;
        let mut inputs =
            vec![("field", motion.read("field").map_err(text)?), ("mask", motion.read("mask").map_err(text)?)];
        for name in ["feat.0", "feat.1", "feat.2", "feat.3"] {
            inputs.push((name, before.backbone.read(name).map_err(text)?));
        }
        let sampling = self.ready(&graph, &inputs)?;
        for (name, tensor) in recorded {
            let (ours, planar) = match name {
                "head.offsets" => ("offsets", false),
                "head.weights" => ("weights", false),
                "out.trajectory_conf" => ("traj_conf", false),
                _ => (name, true),
            };
            let got = sampling.read(ours).map_err(|e| format!("{name}: {e}"))?;
            let want = if planar { tensor.channels_last() } else { tensor.data.clone() };
            report(name, &got[..want.len().min(got.len())], &want);
        }
        Ok(sampling)
    }

    /// Every source image: its sampled field, its points moved without a gate, its trajectories.
    fn points(
        &self,
        before: &Before<'_>,
        motion: &Executable,
        sampling: &Executable,
        report: Report<'_>,
    ) -> Result<(), String> {
        let read = |from: &Executable, name: &str| from.read(name).map_err(text);
        let world = read(before.head, "points")?;
        let (all, samples) = (self.pixels(), self.config.samples());
        let whole = [
            ("offsets", read(sampling, "offsets")?, all * 2 * samples),
            ("weights", read(sampling, "weights")?, all * samples),
            ("field", read(motion, "field")?, self.config.levels() * self.images * self.cells() * 9),
            ("mask", read(motion, "mask")?, self.cells()),
            ("points", world.clone(), all * 3),
        ];
        let (mut scores, mut paths, mut tau, mut moved) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
        for source in 0..self.images {
            let part =
                |(name, data, size): &(&'static str, Vec<f32>, usize)| (*name, data[source * size..][..*size].to_vec());
            let mut inputs: Vec<(&str, Vec<f32>)> = whole.iter().map(part).collect();
            inputs.push(("when", [source as u32, 0].map(f32::from_bits).to_vec()));
            let fused = self.ready(&self.fused()?, &inputs)?;
            scores.extend(read(&fused, "theta")?);
            paths.extend(read(&fused, "trajectory")?);
            let steps = self.ready(&self.steps()?, &inputs)?;
            tau.extend(read(&steps, "tau")?);
            moved.extend(read(&steps, "moved")?);
        }
        let start = |got: &[f32], want: &Tensor| got[..want.data.len().min(got.len())].to_vec();
        if let Some(want) = self.case.get("out.points") {
            report("out.points", &world, &want.data);
        }
        if let Some(want) = self.case.get("tau") {
            report("tau", &start(&tau, want), &want.data);
        }
        let Some(recorded_scores) = self.case.get("out.pixel_score") else { return Ok(()) };
        report("out.pixel_score", &scores, &recorded_scores.data);
        let Gate::Hard(gate) = self.config.motion().gate else {
            return Err("a case without a hard gate: say where its trajectories are to be compared".to_owned());
        };
        if let Some(want) = self.case.get("out.trajectory") {
            let decided = |pixel: usize| (recorded_scores.data[pixel] - gate).abs() > UNDECIDED;
            let (got, want) = self.kept(&paths, &want.data, &decided);
            report("out.trajectory", &got, &want);
        }
        if let Some(want) = self.case.get("moved") {
            let above = |pixel: usize| recorded_scores.data[pixel] > gate;
            let (got, want) = self.kept(&start(&moved, want), &want.data, &above);
            report("moved", &got, &want);
        }
        Ok(())
    }

    /// The pixels (over all images) that `keep` says, of two `[image, time, pixel, 3]`.
    fn kept(&self, got: &[f32], want: &[f32], keep: &dyn Fn(usize) -> bool) -> (Vec<f32>, Vec<f32>) {
        let pixels = self.pixels();
        let place = |i: usize| i / (3 * pixels) / self.images * pixels + i / 3 % pixels;
        let chosen = |data: &[f32]| {
            data.iter().enumerate().filter(|(i, _)| keep(place(*i))).map(|(_, v)| *v).collect::<Vec<f32>>()
        };
        (chosen(got), chosen(want))
    }

    fn fused(&self) -> Result<Graph, String> {
        let mut graph = Graph::new();
        let spec = TrajectorySpec {
            grid: self.grid,
            levels: self.config.levels(),
            points: self.config.head.points,
            all_times: self.images,
            times: self.images,
            pixels: None,
            gathered: false,
            motion: self.config.motion(),
        };
        trajectory(&mut graph, &spec).map_err(text)?;
        Ok(graph)
    }

    /// The same in two steps, with what lies between them, and without a gate.
    fn steps(&self) -> Result<Graph, String> {
        let (all, samples) = (self.pixels(), self.config.samples());
        let mut g = Graph::new();
        let offsets = g.input("offsets", [all, 2 * samples]);
        let weights = g.input("weights", [all, samples]);
        let field = g.input("field", [self.config.levels(), self.images, self.cells(), 9]);
        let mask = g.input("mask", [self.cells()]);
        let points = g.input("points", [all, 3]);
        let when = g.input("when", [2]);
        let image = [self.grid.0 * 14, self.grid.1 * 14];
        let grid = [self.grid.0, self.grid.1];
        let tau =
            g.deform_sample(&Sampling { offsets, weights, field, mask, pixels: None, image, grid }).map_err(text)?;
        g.output(tau, "tau");
        let motion = Motion { gate: Gate::None, ..self.config.motion() };
        let (moved, _) = g.traj_apply(tau, points, when, motion).map_err(text)?;
        g.output(moved, "moved");
        Ok(g)
    }
}

/// `[a, a, rest]` with the first two dimensions exchanged.
fn transposed(data: &[f32], a: usize) -> Vec<f32> {
    let rest = data.len() / (a * a);
    (0..a * a).flat_map(|i| &data[(i % a * a + i / a) * rest..][..rest]).copied().collect()
}
