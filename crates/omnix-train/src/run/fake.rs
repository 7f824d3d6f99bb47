//! A step without a network, for tests of the loop: weights w that are drawn to a number t of the sample, its mean depth.
//!
//! Loss Σ (w − t)² / 2 over all trained numbers, gradient w − t; AdamW as written in its paper, in f32, one number after the other.

use omnix_data::Sample;

use crate::StepError;
use crate::groups::{ARENA, Group, Layout, Tensor};
use crate::interface::{Judged, LossValues, Part, Step, Update};
use crate::peers::Peers;

pub(super) struct Fake {
    layout: Layout,
    /// Weights, means of gradients and of squares, average; one flat list each.
    parts: [Vec<f32>; 4],
    gradient: Vec<f32>,
    /// What it says that it is.
    pub(super) device: &'static str,
    /// Ends the process, as it were, in this step.
    pub(super) dies_in: Option<u64>,
    /// The loss of this sample is NaN.
    pub(super) nan_at: Option<u64>,
    /// The weights become infinite in this step.
    pub(super) explodes_in: Option<u64>,
}

fn target(sample: &Sample) -> f32 {
    let depth = sample.depth(0).unwrap();
    depth.iter().sum::<f32>() / depth.len() as f32
}

const fn index(part: Part) -> usize {
    match part {
        Part::Weights => 0,
        Part::First => 1,
        Part::Second => 2,
        Part::Average => 3,
    }
}

impl Fake {
    pub(super) fn new(groups: &[Group]) -> Self {
        let tensor =
            |name: &str, shape: &[usize], reached| Tensor { name: name.to_owned(), shape: shape.to_vec(), reached };
        let tensors = [
            tensor("backbone.pretrained.cls_token", &[3], true),
            tensor("backbone.pretrained.norm.weight", &[2], false),
            tensor("head.norm.weight", &[10, 7], true),
        ];
        let layout = Layout::new(&tensors, groups, ARENA).unwrap();
        let zeros = vec![0.0; layout.len()];
        let mut parts = [zeros.clone(), zeros.clone(), zeros.clone(), zeros.clone()];
        for slot in &layout.slots {
            parts[0][slot.range.clone()].iter_mut().enumerate().for_each(|(i, w)| *w = i as f32 / 10.0);
        }
        parts[3] = parts[0].clone();
        Self { layout, parts, gradient: zeros, device: "loops", dies_in: None, nan_at: None, explodes_in: None }
    }

    fn losses(&self, sample: &Sample, part: Part) -> LossValues {
        let (t, weights) = (target(sample), &self.parts[index(part)]);
        let of = |slot: &crate::groups::Slot| {
            weights[slot.range.clone()].iter().map(|w| f64::from(w - t).powi(2) / 2.0).sum()
        };
        let terms: Vec<(String, f64)> = self.layout.slots.iter().map(|slot| (slot.name.clone(), of(slot))).collect();
        LossValues { total: terms.iter().map(|(_, value)| value).sum(), terms }
    }
}

impl Step for Fake {
    fn layout(&self) -> &Layout {
        &self.layout
    }

    fn device(&self) -> String {
        self.device.to_owned()
    }

    fn train(&mut self, sample: &Sample, number: u64) -> Result<LossValues, StepError> {
        let t = target(sample);
        for slot in &self.layout.slots {
            slot.range.clone().for_each(|i| self.gradient[i] += self.parts[0][i] - t);
        }
        let mut losses = self.losses(sample, Part::Weights);
        if self.nan_at == Some(number) {
            losses.terms[1].1 = f64::NAN;
        }
        Ok(losses)
    }

    fn validate(&mut self, sample: &Sample, averaged: bool) -> Result<(LossValues, Option<Judged>), StepError> {
        Ok((self.losses(sample, if averaged { Part::Average } else { Part::Weights }), None))
    }

    fn exchange(&mut self, peers: &dyn Peers) -> Result<(), StepError> {
        let own = std::mem::replace(&mut self.gradient, vec![0.0; self.layout.len()]);
        for rank in 0..peers.count() {
            let mut numbers = own.clone();
            peers.broadcast(rank, &mut numbers)?;
            self.gradient.iter_mut().zip(&numbers).for_each(|(sum, one)| *sum += one);
        }
        Ok(())
    }

    fn apply(&mut self, update: &Update) -> Result<f64, StepError> {
        if self.dies_in == Some(update.step) {
            return Err("killed".into());
        }
        let share = 1.0 / update.samples as f32;
        let norm = self.gradient.iter().map(|g| f64::from(g * share).powi(2)).sum::<f64>().sqrt();
        let factor = update.clip.map_or(1.0, |clip| (clip / norm).min(1.0)) as f32 * share;
        let (b1, b2) = (0.9f32, 0.95f32);
        let corrections = [b1, b2].map(|b| 1.0 - b.powi(update.step as i32));
        let [weights, first, second, average] = &mut self.parts;
        for slot in &self.layout.slots {
            let (rate, decay) = (update.rates[slot.group] as f32, update.decays[slot.group] as f32);
            for i in slot.range.clone() {
                let g = self.gradient[i] * factor;
                first[i] = b1 * first[i] + (1.0 - b1) * g;
                second[i] = b2 * second[i] + (1.0 - b2) * g * g;
                let change = first[i] / corrections[0] / ((second[i] / corrections[1]).sqrt() + 1e-8);
                weights[i] -= rate * (change + decay * weights[i]);
                if let Some(keep) = update.average {
                    average[i] = keep as f32 * average[i] + (1.0 - keep as f32) * weights[i];
                }
            }
        }
        self.gradient.fill(0.0);
        if self.explodes_in == Some(update.step) {
            self.parts[0][1] = f32::INFINITY;
        }
        Ok(norm)
    }

    fn not_finite(&mut self) -> Option<String> {
        let broken = |slot: &&crate::groups::Slot| self.parts[0][slot.range.clone()].iter().any(|w| !w.is_finite());
        self.layout.slots.iter().find(broken).map(|slot| slot.name.clone())
    }

    fn read(&mut self, part: Part, arena: usize) -> Result<Vec<f32>, StepError> {
        Ok(self.parts[index(part)][self.layout.arenas[arena].range.clone()].to_vec())
    }

    fn write(&mut self, part: Part, arena: usize, numbers: &[f32]) -> Result<(), StepError> {
        self.parts[index(part)][self.layout.arenas[arena].range.clone()].copy_from_slice(numbers);
        Ok(())
    }

    fn fixed(&mut self, name: &str) -> Result<Vec<f32>, StepError> {
        let (_, shape) = self.layout.fixed.iter().find(|(fixed, _)| fixed == name).unwrap();
        Ok((1..=shape.iter().product()).map(|i: usize| i as f32).collect())
    }
}
