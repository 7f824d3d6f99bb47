//! The step itself: plans and lists on a device, driven through the trait [`Step`].

use std::ops::ControlFlow;

use omnix_data::Sample;
use omnix_eval::network::{Answer, Motion, score};
use omnix_geometry::{Camera, decode_pose_code};
use omnix_graph::profile::{Span, profile};
use omnix_graph::{Executable, GraphError, ParameterSource, WeightStore};
use omnix_io::Picture;
use omnix_io::preprocess::normalise;
use omnix_kernels::{Gpu, adamw, readback};
use omnix_model::DRAW;

use super::plan::{ANSWER, LOSSES, StepPlan};
use super::state::{List, gradients_of, weights_of};
use super::targets;
use super::update::{self, CLIP, Lists, Optimiser, SHARES};
use crate::TrainError;
use crate::error::StepError;
use crate::groups::Layout;
use crate::interface::{Judged, LossValues, Part, Step, Update};
use crate::peers::Peers;

/// A network in training on a device.
pub struct DeviceStep {
    gpu: Gpu,
    plan: StepPlan,
    optimiser: Optimiser,
    /// Tensors that stay as they are.
    source: Box<dyn ParameterSource + Send>,
    train: Executable,
    forward: Executable,
    averaged: Option<Executable>,
    update: Executable,
    /// Where gradients of several samples are added up: how, and which list has those of the sample at hand.
    accumulate: Option<(Executable, List)>,
    /// Where several processes train together.
    exchange: Option<Exchange>,
    lists: State,
    /// Samples since the last update.
    samples: u32,
}

/// How the gradients of several processes are added up.
struct Exchange {
    /// This process's, of all its samples.
    own: List,
    /// Those of one process after another.
    received: List,
    /// Adds what was received to the sum.
    sum: Executable,
}

/// The lists that outlive a step.
struct State {
    weights: List,
    first: List,
    second: List,
    /// Of all samples since the last update, of all processes.
    gradients: List,
    average: Option<List>,
}

impl std::fmt::Debug for DeviceStep {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DeviceStep").field("size", &self.plan.size).finish_non_exhaustive()
    }
}

impl DeviceStep {
    /// Makes a planned step ready, with all trained numbers 0: [`Step::write`] gives them their values. `source` has the tensors that stay
    /// as they are.
    ///
    /// # Errors
    /// When memory runs out, a tensor cannot be read or a pipeline cannot be made.
    pub fn new(
        gpu: &Gpu,
        plan: StepPlan,
        optimiser: Optimiser,
        average: bool,
        source: Box<dyn ParameterSource + Send>,
    ) -> Result<Self, TrainError> {
        let list = |what: &str| List::new(gpu, &plan.layout, what).map_err(GraphError::from);
        let lists = State {
            weights: list("weights")?,
            first: list("first moments")?,
            second: list("second moments")?,
            gradients: list("gradients")?,
            average: if average { Some(list("average weights")?) } else { None },
        };
        let several = optimiser.peers > 1;
        let parts = if optimiser.accumulate > 1 || several { Some(list("gradients of a sample")?) } else { None };
        let own = if several { Some(list("gradients of this process")?) } else { None };
        let go = &mut |_, _| ControlFlow::Continue(());
        let keys: Vec<_> = plan.train.weights.iter().chain(&plan.forward.weights).cloned().collect();
        let store = WeightStore::load(gpu, &*source, &keys, go)?;
        let mut bindings = weights_of(&plan.layout, &lists.weights);
        let forward = Executable::new(gpu, plan.forward.clone(), &store, &bindings)?;
        bindings.extend(gradients_of(&plan.layout, parts.as_ref().unwrap_or(&lists.gradients)));
        let train = Executable::new(gpu, plan.train.clone(), &store, &bindings)?;
        let averaged = match &lists.average {
            Some(average) => {
                Some(Executable::new(gpu, plan.forward.clone(), &store, &weights_of(&plan.layout, average))?)
            }
            None => None,
        };
        let update = update::update(
            gpu,
            &plan.layout,
            &optimiser,
            &Lists {
                weights: &lists.weights,
                first: &lists.first,
                second: &lists.second,
                gradients: &lists.gradients,
                average: lists.average.as_ref(),
            },
        )?;
        let exchange = match (&own, &parts) {
            (Some(own), Some(parts)) => {
                let sum = update::accumulate(gpu, &plan.layout, &lists.gradients, parts)?;
                Some(Exchange { own: own.clone(), received: parts.clone(), sum })
            }
            _ => None,
        };
        let accumulate = match parts {
            Some(parts) => {
                let sums = own.as_ref().unwrap_or(&lists.gradients);
                Some((update::accumulate(gpu, &plan.layout, sums, &parts)?, parts))
            }
            None => None,
        };
        let gpu = gpu.clone();
        Ok(Self {
            gpu,
            plan,
            optimiser,
            source,
            train,
            forward,
            averaged,
            update,
            accumulate,
            exchange,
            lists,
            samples: 0,
        })
    }

    /// The numbers of every input for a sample. `number` is the sample's, for what is drawn.
    ///
    /// # Errors
    /// A sample of another size than was planned for.
    pub fn inputs(&self, sample: &Sample, number: u64) -> Result<Vec<(String, Vec<f32>)>, TrainError> {
        let [rows, columns] = self.plan.size.pixels();
        let size = [columns as u32, rows as u32];
        if sample.count() != self.plan.size.images || sample.size() != size {
            return Err(TrainError::OtherSize {
                images: sample.count(),
                size: sample.size(),
                expected_images: self.plan.size.images,
                expected: size,
            });
        }
        let plane = 3 * rows * columns;
        let mut pixels = vec![0.0; plane * sample.count()];
        for (image, place) in pixels.chunks_exact_mut(plane).enumerate() {
            normalise(&Picture::new(size[0], size[1], sample.image(image).to_vec()), place);
        }
        let times: Vec<(u32, u32)> = sample.times().iter().map(|time| (time.video, time.frame)).collect();
        let codes = self.plan.codes.iter().map(|code| (code.name.clone(), code.of(&times)));
        let targets = targets::of(sample, self.plan.wanted, number)?;
        let targets = targets.into_iter().map(|(name, numbers)| (name.to_owned(), numbers));
        Ok(codes.chain(targets).chain([("images".to_owned(), pixels)]).collect())
    }

    /// [`Step::train`] with inputs that the caller has made: for hosts with targets of their own.
    ///
    /// # Errors
    /// Inputs of the wrong length, or a failure of the device.
    pub fn train_on(&mut self, inputs: &[(String, Vec<f32>)]) -> Result<LossValues, TrainError> {
        let losses = self.run(&self.train, inputs)?;
        if let Some((accumulate, _)) = &self.accumulate {
            let before = if self.samples == 0 { 0.0 } else { 1.0 };
            accumulate.write(SHARES, &[before, 1.0])?;
            accumulate.run(&mut |_, _| ControlFlow::Continue(()))?;
        }
        self.samples += 1;
        Ok(losses)
    }

    /// The gradient of a trained tensor, of all samples since the last update.
    ///
    /// # Errors
    /// When no tensor of this name is trained, or the device fails.
    pub fn gradient(&self, tensor: &str) -> Result<Vec<f32>, TrainError> {
        self.tensor(&self.lists.gradients, tensor)
    }

    /// A trained tensor.
    ///
    /// # Errors
    /// As [`DeviceStep::gradient`].
    pub fn weights(&self, tensor: &str) -> Result<Vec<f32>, TrainError> {
        self.tensor(&self.lists.weights, tensor)
    }

    fn tensor(&self, list: &List, tensor: &str) -> Result<Vec<f32>, TrainError> {
        let slot = self.plan.layout.slots.iter().find(|slot| slot.name == tensor);
        let slot = slot.ok_or_else(|| GraphError::NoSuchValue { name: tensor.to_owned() })?;
        Ok(readback::read(&self.gpu, &list.tensor(&self.plan.layout, slot)).map_err(GraphError::from)?)
    }

    /// Time of every operation of forward and backward on the inputs of the last step, then those of the update, which is carried out.
    ///
    /// # Errors
    /// A device without timestamp queries, or a failure of the device.
    pub fn profile(&self) -> Result<[Vec<Span>; 2], TrainError> {
        Ok([profile(&self.train)?, profile(&self.update)?])
    }

    /// Writes the inputs of a plan and runs it.
    fn run(&self, plan: &Executable, inputs: &[(String, Vec<f32>)]) -> Result<LossValues, TrainError> {
        for (name, numbers) in inputs {
            match plan.write(name, numbers) {
                // What no term of the objective looks at is no input.
                Err(GraphError::NoSuchValue { .. }) => {}
                written => written?,
            }
        }
        plan.run(&mut |_, _| ControlFlow::Continue(()))?;
        let numbers = plan.read(LOSSES)?;
        let named = || self.plan.losses.iter().zip(&numbers).map(|(name, value)| (name.as_str(), f64::from(*value)));
        // How many entries counted is no loss.
        let terms = named().filter(|(name, _)| !name.ends_with(".entries"));
        let terms = terms.filter_map(|(name, value)| Some((name.strip_prefix("loss.")?.to_owned(), value)));
        let total = named().find(|(name, _)| *name == "loss.total").map_or(f64::NAN, |(_, value)| value);
        Ok(LossValues { total, terms: terms.filter(|(name, _)| name != "total").collect() })
    }

    fn list(&self, part: Part) -> Result<&List, TrainError> {
        match part {
            Part::Weights => Ok(&self.lists.weights),
            Part::First => Ok(&self.lists.first),
            Part::Second => Ok(&self.lists.second),
            Part::Average => self.lists.average.as_ref().ok_or_else(|| {
                TrainError::contradiction("optimiser.average", "no average of the weights is kept: set a share above 0")
            }),
        }
    }

    /// The first tensor with a number that is NaN or infinite in a list.
    fn bad_tensor(&self, list: &List) -> Option<String> {
        for (index, arena) in self.plan.layout.arenas.iter().enumerate() {
            let numbers = list.read(&self.gpu, index).ok()?;
            if let Some(at) = numbers.iter().position(|v| !v.is_finite()) {
                let at = arena.range.start + at;
                return self.plan.layout.slots.iter().find(|slot| slot.range.contains(&at)).map(|s| s.name.clone());
            }
        }
        None
    }
}

/// What an evaluation says of what a forward pass has just found.
fn judge(plan: &Executable, sample: &Sample, moves: bool) -> Result<Judged, StepError> {
    let [depth, cameras, paths, theta] = ANSWER;
    let (depth, [width, height]) = (plan.read(depth)?, sample.size());
    let codes = plan.read(cameras)?;
    let codes = codes.chunks_exact(9).map(|code| decode_pose_code(std::array::from_fn(|i| code[i]), height, width));
    let cameras: Vec<Camera> = codes.collect();
    let (paths, theta) = if moves { (plan.read(paths)?, plan.read(theta)?) } else { (Vec::new(), Vec::new()) };
    let positions: Vec<[f32; 3]> = paths.chunks_exact(3).map(|p| [p[0], p[1], p[2]]).collect();
    let motion = moves.then_some(Motion { positions: &positions, theta: &theta });
    Ok(score(sample, &Answer { depth: &depth, cameras: &cameras, motion })?)
}

impl Step for DeviceStep {
    fn layout(&self) -> &Layout {
        &self.plan.layout
    }

    fn device(&self) -> String {
        let (info, caps) = (self.gpu.device.adapter_info(), &self.gpu.caps);
        format!("{} ({} {}; {} variants)", info.name, info.driver, info.driver_info, caps.tier)
    }

    fn train(&mut self, sample: &Sample, number: u64) -> Result<LossValues, StepError> {
        let mut inputs = self.inputs(sample, number)?;
        // u32 in the bits of an f32: what is left out at random differs from sample to sample.
        inputs.push((DRAW.to_owned(), vec![f32::from_bits(number as u32)]));
        Ok(self.train_on(&inputs)?)
    }

    fn validate(&mut self, sample: &Sample, averaged: bool) -> Result<(LossValues, Option<Judged>), StepError> {
        let plan = if averaged { self.averaged.as_ref() } else { None };
        let plan = plan.unwrap_or(&self.forward);
        let losses = self.run(plan, &self.inputs(sample, 0)?)?;
        Ok((losses, Some(judge(plan, sample, self.plan.wanted.moves)?)))
    }

    fn exchange(&mut self, peers: &dyn Peers) -> Result<(), StepError> {
        if peers.count() == 1 {
            return Ok(());
        }
        let Some(Exchange { own, received, sum }) = &self.exchange else {
            return Err("BUG: a step that was planned for one process".into());
        };
        for rank in 0..peers.count() {
            for (index, arena) in self.plan.layout.arenas.iter().enumerate() {
                let mut numbers = match rank == peers.rank() {
                    true => own.read(&self.gpu, index)?,
                    false => vec![0.0; arena.range.len()],
                };
                peers.broadcast(rank, &mut numbers)?;
                received.write(&self.gpu, index, &numbers)?;
            }
            sum.write(SHARES, &[if rank == 0 { 0.0 } else { 1.0 }, 1.0])?;
            sum.run(&mut |_, _| ControlFlow::Continue(()))?;
        }
        self.samples *= peers.count();
        Ok(())
    }

    fn apply(&mut self, update: &Update) -> Result<f64, StepError> {
        if update.samples != self.samples || update.samples != self.optimiser.samples() {
            let (samples, planned) = (self.samples, self.optimiser.samples());
            let reason =
                format!("BUG: an update after {samples} samples, of {}, planned for {planned}", update.samples);
            return Err(reason.into());
        }
        let adamw = adamw::AdamW { n: 0, betas: self.optimiser.betas, eps: self.optimiser.eps, scale: 1.0, clip: true };
        for (group, (rate, decay)) in update.rates.iter().zip(&update.decays).enumerate() {
            match self.update.write(&update::rates(group), &adamw.rates(update.step, *rate, *decay)) {
                // A group without trained tensors.
                Err(GraphError::NoSuchValue { .. }) => {}
                written => written?,
            }
        }
        if let Some(keep) = update.average {
            self.update.write(SHARES, &[keep as f32, (1.0 - keep) as f32])?;
        }
        self.update.run(&mut |_, _| ControlFlow::Continue(()))?;
        self.samples = 0;
        let clip = self.update.read(CLIP)?;
        Ok(clip.get(1).map_or(f64::NAN, |norm| f64::from(*norm)))
    }

    fn not_finite(&mut self) -> Option<String> {
        // Those of the last sample, and the sum: of other samples and other processes.
        let parts = self.accumulate.as_ref().map(|(_, parts)| parts);
        let lists = [Some(&self.lists.weights), parts, Some(&self.lists.gradients)];
        lists.into_iter().flatten().find_map(|list| self.bad_tensor(list))
    }

    fn read(&mut self, part: Part, arena: usize) -> Result<Vec<f32>, StepError> {
        Ok(self.list(part)?.read(&self.gpu, arena)?)
    }

    fn write(&mut self, part: Part, arena: usize, numbers: &[f32]) -> Result<(), StepError> {
        let expected = self.plan.layout.arenas[arena].range.len();
        if numbers.len() != expected {
            return Err(TrainError::Length { what: "an arena", expected, got: numbers.len() }.into());
        }
        Ok(self.list(part)?.write(&self.gpu, arena, numbers)?)
    }

    fn fixed(&mut self, name: &str) -> Result<Vec<f32>, StepError> {
        Ok(self.source.read(name)?.into_owned())
    }
}
