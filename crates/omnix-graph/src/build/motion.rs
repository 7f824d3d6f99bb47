//! The trajectory module: expansion over target times, fields, sampling, and points that move.

use crate::error::GraphError;
use crate::graph::{Graph, Shape, Value};
use crate::op::{Motion, Op, Sampling, Trajectory};

/// The optional parts of [`Graph::token_expand`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Expand {
    /// `[T, d]`; 0 where absent.
    pub scale: Option<Value>,
    /// One number a token for the scale; 1 where absent.
    pub alpha: Option<Value>,
    /// One number a token for the shift; 1 where absent.
    pub kappa: Option<Value>,
}

impl Graph {
    /// `z[t, r] = q[r] · (1 + alpha[r] · scale[t]) + kappa[r] · shift[t]`: `[T, m, d]` of `q [.., d]` and `shift [T, d]`.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn token_expand(&mut self, q: Value, shift: Value, parts: Expand) -> Result<Value, GraphError> {
        let op = "token_expand";
        let (m, d) = (self.shape(q).rows(), self.shape(q).width());
        let times = match **self.shape(shift) {
            [times, width] if width == d => times,
            _ => return Err(self.misfit(op, shift, format!("[times, {d}]"))),
        };
        if let Some(scale) = parts.scale {
            self.expect(op, scale, &[times, d])?;
        }
        for value in [parts.alpha, parts.kappa].into_iter().flatten() {
            if self.shape(value).elements() != m {
                return Err(self.misfit(op, value, format!("one number for each of {m} tokens")));
            }
        }
        let Expand { scale, alpha, kappa } = parts;
        Ok(self.push_one(Op::TokenExpand { q, scale, shift, alpha, kappa }, [times, m, d]))
    }

    /// `field[s, t, index[s, i]] = z[t, s, i]` and `rest [c]` elsewhere: `[S, T, cells, c]` of `z [T, S, K, c]` and u32
    /// `index [S, K]`, ascending in each row.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn field_scatter(&mut self, z: Value, index: Value, rest: Value, cells: usize) -> Result<Value, GraphError> {
        let op = "field_scatter";
        let [times, sources, k, c] = <[usize; 4]>::try_from(&**self.shape(z))
            .map_err(|_| self.misfit(op, z, "[times, sources, tokens, channels]"))?;
        if k > cells {
            return Err(self.misfit(op, z, format!("at most {cells} tokens of an image")));
        }
        if self.shape(index).elements() != sources * k {
            return Err(self.misfit(op, index, format!("[{sources}, {k}]")));
        }
        self.expect(op, rest, &[c])?;
        Ok(self.push_one(Op::FieldScatter { z, index, rest }, [sources, times, cells, c]))
    }

    /// The field and the mask of an image at its pixels' sampling points: `[n, 9 T + 1]`, times then the score.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn deform_sample(&mut self, sampling: &Sampling) -> Result<Value, GraphError> {
        let (n, times) = self.sampling("deform_sample", sampling)?;
        Ok(self.push_one(Op::DeformSample(*sampling), [n, times * 9 + 1]))
    }

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
        self.points_of(op, points, n)?;
        if self.shape(when).elements() == 0 {
            return Err(self.misfit(op, when, "[1]"));
        }
        let shapes = [Shape::from([width / 9, n, 3]), Shape::from([n])];
        let outputs = self.push(Op::TrajApply { tau, points, when, motion }, shapes);
        Ok((outputs[0], outputs[1]))
    }

    /// Points at a range of target times straight from the field: `([times, n, 3], score [n])`, the bits of
    /// [`Graph::deform_sample`] and [`Graph::traj_apply`] whatever the range.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn trajectory(&mut self, trajectory: &Trajectory) -> Result<(Value, Value), GraphError> {
        let op = "trajectory";
        let (n, all) = self.sampling(op, &trajectory.sampling)?;
        self.points_of(op, trajectory.points, n)?;
        self.expect(op, trajectory.when, &[2])?;
        let nt = trajectory.times;
        if nt == 0 || nt > all {
            return Err(self.misfit(op, trajectory.sampling.field, format!("[levels, {nt} or more times, cells, 9]")));
        }
        let [levels, _, cells, _] = <[usize; 4]>::try_from(&**self.shape(trajectory.sampling.field))
            .map_err(|_| self.misfit(op, trajectory.sampling.field, "[levels, times, cells, 9]"))?;
        let packed = omnix_kernels::trajectory::packed_words(levels as u64, nt as u64, cells as u64) as usize;
        // The third and fourth are scratch.
        let shapes = [Shape::from([nt, n, 3]), Shape::from([n]), Shape::from([n, 12]), Shape::from([packed])];
        let outputs = self.push(Op::Trajectory(*trajectory), shapes);
        Ok((outputs[0], outputs[1]))
    }

    /// Checks the shapes of a sampling; pixels and times.
    fn sampling(&self, op: &'static str, s: &Sampling) -> Result<(usize, usize), GraphError> {
        let cells = s.grid[0] * s.grid[1];
        let (levels, times) = match **self.shape(s.field) {
            [levels, times, l, 9] if l == cells && levels > 0 => (levels, times),
            _ => return Err(self.misfit(op, s.field, format!("[levels, times, {cells}, 9]"))),
        };
        let (n, taps) = (self.shape(s.weights).rows(), self.shape(s.weights).width());
        if taps == 0 || !taps.is_multiple_of(levels) {
            return Err(self.misfit(op, s.weights, format!("[n, {levels} levels x points]")));
        }
        if (self.shape(s.offsets).rows(), self.shape(s.offsets).width()) != (n, taps * 2) {
            return Err(self.misfit(op, s.offsets, format!("[{n}, {}]", taps * 2)));
        }
        if self.shape(s.mask).elements() != cells {
            return Err(self.misfit(op, s.mask, format!("[{cells}]")));
        }
        let listed = s.pixels.map(|pixels| (pixels, self.shape(pixels).elements()));
        match listed {
            Some((pixels, count)) if count != n => Err(self.misfit(op, pixels, format!("[{n}]"))),
            None if s.image[0] * s.image[1] != n => {
                Err(self.misfit(op, s.weights, format!("a row for each of {} x {} pixels", s.image[1], s.image[0])))
            }
            _ => Ok((n, times)),
        }
    }

    fn points_of(&self, op: &'static str, points: Value, n: usize) -> Result<(), GraphError> {
        let shape = self.shape(points);
        if shape.width() == 3 && shape.rows() == n { Ok(()) } else { Err(self.misfit(op, points, format!("[{n}, 3]"))) }
    }
}
