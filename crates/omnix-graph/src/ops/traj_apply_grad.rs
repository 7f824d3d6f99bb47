//! The gradient of [`super::TrajApply`]: of moved points and scores to tau and to the points.

use omnix_kernels::KernelError;
use omnix_kernels::traj_apply::Motion;
use omnix_kernels::traj_apply_grad::{self, STATE_WORDS};

use super::sampling::check_points;
use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// The gradient of points that were moved.
#[derive(Clone, Debug)]
pub struct TrajApplyGrad {
    /// `[n, 9 T + 1]`.
    pub tau: Value,
    /// `[n, 3]`.
    pub points: Value,
    /// u32; the first is the image's own time.
    pub when: Value,
    /// How points move.
    pub motion: Motion,
    /// Gradient of the moved points, `[T, n, 3]`.
    pub dy: Value,
    /// Gradient of the scores, n numbers; else 0.
    pub dscore: Option<Value>,
}

impl<O: Operation + From<TrajApplyGrad>> Graph<O> {
    /// The gradient of [`Graph::traj_apply`]: of `dy [T, n, 3]` and the scores' `dscore [n]` to `tau` and to the points.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn traj_apply_grad(
        &mut self,
        (tau, points, when): (Value, Value, Value),
        motion: Motion,
        dy: Value,
        dscore: Option<Value>,
    ) -> Result<(Value, Value), GraphError> {
        let op = "traj_apply_grad";
        let (n, width) = (self.shape(tau).rows(), self.shape(tau).width());
        if width < 10 || width % 9 != 1 {
            return Err(self.misfit(op, tau, "[n, 9 times + 1]"));
        }
        check_points(self, op, points, n)?;
        if self.shape(when).elements() == 0 {
            return Err(self.misfit(op, when, "[1]"));
        }
        self.expect(op, dy, &[width / 9, n, 3])?;
        if let Some(dscore) = dscore.filter(|v| self.shape(*v).elements() != n) {
            return Err(self.misfit(op, dscore, format!("[{n}]")));
        }
        let shapes = [self.shape(tau).clone(), self.shape(points).clone(), Shape::from([n, STATE_WORDS as usize])];
        let outputs = self.push(TrajApplyGrad { tau, points, when, motion, dy, dscore }, shapes);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for TrajApplyGrad {
    fn name(&self) -> &'static str {
        "traj_apply_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { tau, points, when, dy, dscore, .. } = self;
        map_all([tau, points, when, dy].into_iter().chain(dscore), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let shape = site.values.shape(self.dy);
        let spec = traj_apply_grad::TrajApplyGrad {
            n: site.n(shape[1])?,
            times: site.n(shape[0])?,
            motion: self.motion,
            theta: self.dscore.is_some(),
        };
        let inputs = [Some(self.tau), Some(self.points), Some(self.when), Some(self.dy), self.dscore];
        let args = inputs.into_iter().chain(site.outputs.iter().copied().map(Some));
        site.call(args, spec.record(site.caps)?)
    }

    /// Some 250 for a point at a time.
    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        80 * values.shape(self.dy).elements() as u64
    }
}
