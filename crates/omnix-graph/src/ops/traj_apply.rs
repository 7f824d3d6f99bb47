//! Points moved by what was sampled: 6D rotation and translation for each time, and a gate.

use omnix_kernels::KernelError;
use omnix_kernels::traj_apply::{self, Motion};

use super::sampling::check_points;
use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Points moved by what [`super::DeformSample`] made, and their scores.
#[derive(Clone, Debug)]
pub struct TrajApply {
    /// `[n, 9 T + 1]`.
    pub tau: Value,
    /// `[n, 3]`.
    pub points: Value,
    /// u32; the first is the image's own time.
    pub when: Value,
    /// How points move.
    pub motion: Motion,
}

impl<O: Operation + From<TrajApply>> Graph<O> {
    /// Points `[n, 3]` moved by `tau [n, 9 T + 1]`: `([T, n, 3], score [n])`. `when` is u32, its first number the image's own
    /// time.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn traj_apply(
        &mut self,
        tau: Value,
        points: Value,
        when: Value,
        motion: Motion,
    ) -> Result<(Value, Value), GraphError> {
        let op = "traj_apply";
        let (n, width) = (self.shape(tau).rows(), self.shape(tau).width());
        if width < 10 || width % 9 != 1 {
            return Err(self.misfit(op, tau, "[n, 9 times + 1]"));
        }
        check_points(self, op, points, n)?;
        if self.shape(when).elements() == 0 {
            return Err(self.misfit(op, when, "[1]"));
        }
        let shapes = [Shape::from([width / 9, n, 3]), Shape::from([n])];
        let outputs = self.push(TrajApply { tau, points, when, motion }, shapes);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for TrajApply {
    fn name(&self) -> &'static str {
        "traj_apply"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.tau, &mut self.points, &mut self.when], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let [points, score] = [site.outputs[0], site.outputs[1]];
        let shape = site.values.shape(points);
        let spec = traj_apply::TrajApply { n: site.n(shape[1])?, times: site.n(shape[0])?, motion: self.motion };
        site.call([self.tau, self.points, self.when, points, score].map(Some), spec.record(site.caps)?)
    }

    /// Rotating and moving a point takes about 90.
    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        30 * values.shape(outputs[0]).elements() as u64
    }
}
