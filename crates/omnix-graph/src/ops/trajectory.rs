//! Points of one source image at a range of target times, straight from its field: `deform_sample` and `traj_apply` in one.

use omnix_kernels::traj_apply::Motion;
use omnix_kernels::{KernelError, trajectory};
use smallvec::{SmallVec, smallvec};

use super::sampling::{Sampling, check_points};
use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// What points, sampled where, moved how: see `omnix_kernels::trajectory`.
#[derive(Clone, Copy, Debug)]
pub struct Trajectory {
    /// Pixels, grid, field and mask.
    pub sampling: Sampling,
    /// World points, three numbers for each row of the offsets.
    pub points: Value,
    /// u32 `[2]`: the image's own time, and the first target time.
    pub when: Value,
    /// Target times of the range.
    pub times: usize,
    /// How points move.
    pub motion: Motion,
}

impl<O: Operation + From<Trajectory>> Graph<O> {
    /// Points at a range of target times straight from the field: `([times, n, 3], score [n])`, the bits of
    /// [`Graph::deform_sample`] and [`Graph::traj_apply`] whatever the range.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn trajectory(&mut self, trajectory: &Trajectory) -> Result<(Value, Value), GraphError> {
        let op = "trajectory";
        let (n, all) = trajectory.sampling.check(self, op)?;
        check_points(self, op, trajectory.points, n)?;
        self.expect(op, trajectory.when, &[2])?;
        let nt = trajectory.times;
        if nt == 0 || nt > all {
            return Err(self.misfit(op, trajectory.sampling.field, format!("[levels, {nt} or more times, cells, 9]")));
        }
        let [levels, _, cells, _] = <[usize; 4]>::try_from(&**self.shape(trajectory.sampling.field))
            .map_err(|_| self.misfit(op, trajectory.sampling.field, "[levels, times, cells, 9]"))?;
        let packed = trajectory::packed_words(levels as u64, nt as u64, cells as u64) as usize;
        // The third and fourth are scratch.
        let shapes = [Shape::from([nt, n, 3]), Shape::from([n]), Shape::from([n, 12]), Shape::from([packed])];
        let outputs = self.push(*trajectory, shapes);
        Ok((outputs[0], outputs[1]))
    }
}

impl Operation for Trajectory {
    fn name(&self) -> &'static str {
        "trajectory"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.points, &mut self.when], map);
        self.sampling.map_inputs(map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let spec = trajectory::Trajectory {
            sample: self.sampling.spec(site.values)?,
            nt: site.n(self.times)?,
            motion: self.motion,
        };
        let own = [self.points, self.when].into_iter().chain(site.outputs.iter().copied()).map(Some);
        site.call(self.sampling.args().into_iter().chain(own), spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        let taps = values.shape(self.sampling.weights).elements() as u64;
        8 * taps * (9 * (self.times as u64 + 1) + 1) + 30 * values.shape(outputs[0]).elements() as u64
    }

    /// The field as the kernel packs it.
    fn windowed(&self, outputs: &[Value]) -> SmallVec<[Value; 2]> {
        smallvec![outputs[3]]
    }
}
