//! The stages on the device: with weights that stay as long as the session, with weights of their own, or, where a stage runs
//! once, with weights that pass through.

use std::ops::{ControlFlow, Deref};

use omnix_graph::WeightKey;
use omnix_graph::{Bindings, Executable, GraphError, Plan, Streamed, Tensors, WeightStore};
use omnix_kernels::Gpu;

use crate::error::OmnixError;
use crate::event::{Listener, Phase, Teller};
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
    pub(super) fn new(
        gpu: &Gpu,
        weights: &Weights,
        plan: &RunPlan,
        listener: Listener<'_>,
    ) -> Result<Self, OmnixError> {
        let keys: Vec<WeightKey> = plan.plans().flat_map(|(plan, _)| &plan.weights).cloned().collect();
        let kept = if plan.request.keep_weights {
            let mut teller = Teller::new(listener);
            let loaded =
                WeightStore::load(gpu, weights, &keys, &mut |done, total| teller.progress(Phase::Weights, done, total));
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
    pub(super) fn stage(
        &self,
        plan: &Plan,
        bindings: &Bindings,
        listener: Listener<'_>,
    ) -> Result<OnDevice, OmnixError> {
        if let Some(store) = &self.kept {
            return Ok(OnDevice::Loaded(Executable::new(&self.gpu, plan.clone(), store, bindings)?));
        }
        // Buffers are given back when the device is next waited for.
        self.gpu.wait()?;
        if plan.streamed {
            let streamed = Streamed::new(&self.gpu, plan.clone(), bindings)?;
            return Ok(OnDevice::Streamed(streamed, Box::new(self.weights.clone())));
        }
        let mut teller = Teller::new(listener);
        let mut report = |done, total| teller.progress(Phase::Weights, done, total);
        let loaded = WeightStore::load(&self.gpu, &self.weights, &plan.weights, &mut report);
        let store = teller.end(loaded)?;
        Ok(OnDevice::Loaded(Executable::new(&self.gpu, plan.clone(), &store, bindings)?))
    }
}

impl OnDevice {
    /// Runs and waits, see [`Executable::run`].
    pub(super) fn run(&self, progress: &mut dyn FnMut(u64, u64) -> ControlFlow<()>) -> Result<(), GraphError> {
        match self {
            Self::Loaded(executable) => executable.run(progress),
            Self::Streamed(streamed, weights) => streamed.run(&**weights, progress),
        }
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
