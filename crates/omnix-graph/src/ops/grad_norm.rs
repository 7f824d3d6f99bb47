//! The norm of many gradients together, and the factor that clips it, on the device.

use omnix_kernels::KernelError;
use omnix_kernels::grad_norm::{CLIP_WORDS, Clip, Squares, blocks};
use omnix_kernels::reduce::{Reduce, ReduceOp};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// The norm of gradients and the factor that clips it.
#[derive(Clone, Debug)]
pub struct GradNorm {
    /// All gradients, of any shapes.
    pub gradients: Vec<Value>,
    /// Bound and scale.
    pub clip: Clip,
}

impl<O: Operation + From<GradNorm>> Graph<O> {
    /// `[factor, norm, bad, 0]` of all gradients times `scale`: the factor `scale · min(1, max_norm / (norm + 1e-6))` is what each gradient
    /// is to be multiplied by; `bad` is 1 where the norm is NaN or infinite, and then the factor is 0.
    ///
    /// # Errors
    /// When there are no gradients, the bound is not above 0 or the scale is not finite.
    pub fn grad_norm(&mut self, gradients: &[Value], max_norm: f32, scale: f32) -> Result<Value, GraphError> {
        let clip = Clip { max_norm, scale };
        clip.record()?;
        let parts = parts(self, gradients);
        if parts == 0 {
            return Err(GraphError::Arguments { op: "grad_norm", reason: "there are no gradients".to_owned() });
        }
        let scratch = sum(parts)?.scratch();
        let mut shapes = vec![Shape::from([CLIP_WORDS as usize]), Shape::from([parts as usize]), Shape::from([1])];
        shapes.extend(scratch.iter().filter(|words| **words > 0).map(|words| Shape::from([*words as usize])));
        Ok(self.push(GradNorm { gradients: gradients.to_vec(), clip }, shapes)[0])
    }
}

/// Blocks of all gradients.
fn parts(values: &Values, gradients: &[Value]) -> u64 {
    gradients.iter().map(|g| blocks(values.shape(*g).elements() as u64)).sum()
}

/// How their sums are added.
fn sum(parts: u64) -> Result<Reduce, KernelError> {
    Ok(Reduce { outer: 1, n: u32_of("grad_norm", parts as usize)?, inner: 1, op: ReduceOp::Sum })
}

impl Operation for GradNorm {
    fn name(&self) -> &'static str {
        "grad_norm"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all(&mut self.gradients, map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let [clip, parts_to, sum_to] = [0, 1, 2].map(|i| Some(site.outputs[i]));
        let scratch = [site.outputs.get(3).copied(), site.outputs.get(4).copied()];
        let mut calls = Vec::with_capacity(self.gradients.len() + 2);
        let mut first = 0;
        for gradient in &self.gradients {
            let n = site.values.shape(*gradient).elements() as u64;
            let squares = Squares { n, first, scale: self.clip.scale };
            calls.extend(site.call([Some(*gradient), parts_to], squares.record(site.caps)?)?);
            first += blocks(n);
        }
        let [of, more] = scratch;
        calls.extend(site.call([parts_to, sum_to, of, more], sum(first)?.record(site.caps)?)?);
        calls.extend(site.call([sum_to, clip], self.clip.record()?)?);
        Ok(calls)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        self.gradients.iter().map(|g| 2 * values.shape(*g).elements() as u64).sum()
    }
}
