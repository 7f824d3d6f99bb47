//! The stages on the device: with weights that stay as long as the session, with weights of their own, or, where a stage runs
//! once, with weights that pass through.

use std::ops::Deref;

use omnix_graph::WeightKey;
use omnix_graph::{Bindings, Executable, Plan, Run, Streamed, Tensors, WeightStore};
use omnix_kernels::Gpu;

use crate::error::OmnixError;
use crate::event::{Event, Listener, Phase, Progress, Teller};
use crate::plan::RunPlan;
use crate::weights::Weights;

/// The weights of a session.
#[derive(Debug)]
pub(super) struct SessionWeights {
    gpu: Gpu,
    weights: Weights,
    /// All of them on the device, if they stay there.
    kept: Option<WeightStore>,
}

/// A run as a part of a phase.
#[derive(Clone, Copy, Debug)]
pub(super) struct PhasePart {
    pub(super) phase: Phase,
    /// Operations of the phase that were done before.
    pub(super) before: u64,
    /// Operations of the phase.
    pub(super) total: u64,
}

impl PhasePart {
    /// Tells that `done` operations of this part are done.
    pub(super) fn tell(&self, done: u64, listener: Listener<'_>) -> Result<(), OmnixError> {
        listener(Event::Progress(Progress { phase: self.phase, done: self.before + done, total: self.total }))
    }
}

/// A stage that can run.
#[derive(Debug)]
pub(super) enum OnDevice {
    /// Its weights are there.
    Loaded(Executable),
    /// Its weights come while it runs.
    Streamed(Streamed, Box<Weights>),
}

impl SessionWeights {
    /// Uploads all weights if they stay. If not, all are verified, so that no work is lost to a damaged file later: for values that
    /// are NaN or infinite, or would be as they are stored.
    pub(super) async fn new(
        gpu: &Gpu,
        weights: &Weights,
        plan: &RunPlan,
        listener: Listener<'_>,
    ) -> Result<Self, OmnixError> {
        let keys: Vec<WeightKey> = plan.plans().flat_map(|(plan, _)| &plan.weights).cloned().collect();
        let kept = if plan.request.keep_weights {
            let mut teller = Teller::new(listener);
            let mut report = |done, total| teller.progress(Phase::Weights, done, total);
            let loaded = WeightStore::load_async(gpu, weights, &keys, &mut report).await;
            Some(teller.end(loaded)?)
        } else {
            let mut teller = Teller::new(listener);
            let verified = weights.verify(&keys, &mut |done, total| teller.progress(Phase::Weights, done, total));
            teller.end(verified)?;
            None
        };
        Ok(Self { gpu: gpu.clone(), weights: weights.clone(), kept })
    }

    /// What they are from.
    pub(super) fn checkpoint(&self) -> &Weights {
        &self.weights
    }

    /// Makes a stage ready. Whoever has the stage before lets go of it first.
    pub(super) async fn stage(
        &self,
        plan: &Plan,
        bindings: &Bindings,
        listener: Listener<'_>,
    ) -> Result<OnDevice, OmnixError> {
        if let Some(store) = &self.kept {
            return Ok(OnDevice::Loaded(Executable::new(&self.gpu, plan.clone(), store, bindings)?));
        }
        // Buffers are given back when the device is next waited for.
        self.gpu.wait_async().await?;
        if plan.streamed {
            let streamed = Streamed::new(&self.gpu, plan.clone(), bindings)?;
            return Ok(OnDevice::Streamed(streamed, Box::new(self.weights.clone())));
        }
        let mut teller = Teller::new(listener);
        let mut report = |done, total| teller.progress(Phase::Weights, done, total);
        let loaded = WeightStore::load_async(&self.gpu, &self.weights, &plan.weights, &mut report).await;
        let store = teller.end(loaded)?;
        Ok(OnDevice::Loaded(Executable::new(&self.gpu, plan.clone(), &store, bindings)?))
    }
}

impl OnDevice {
    /// Starts a run.
    pub(super) fn start(&self) -> Run<'_> {
        match self {
            Self::Loaded(executable) => executable.start(),
            Self::Streamed(streamed, weights) => streamed.start(&**weights),
        }
    }

    /// Runs, and tells `listener` how much of `phase` is done: what was before, and what this run has done.
    pub(super) async fn run(&self, part: PhasePart, listener: Listener<'_>) -> Result<(), OmnixError> {
        let mut run = self.start();
        while let Some(step) = run.step().await? {
            if let Err(error) = part.tell(step.done, listener) {
                run.stop().await?;
                return Err(error);
            }
        }
        Ok(())
    }
}

impl Deref for OnDevice {
    type Target = Tensors;

    fn deref(&self) -> &Tensors {
        match self {
            Self::Loaded(executable) => executable,
            Self::Streamed(streamed, _) => streamed,
        }
    }
}
