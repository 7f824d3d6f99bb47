//! The trajectory module's operations as kernel calls.

use omnix_kernels::KernelError;
use omnix_kernels::deform_sample::DeformSample;
use omnix_kernels::field_scatter::FieldScatter;
use omnix_kernels::token_expand::TokenExpand;
use omnix_kernels::traj_apply::TrajApply;
use omnix_kernels::trajectory::Trajectory;
use smallvec::smallvec;

use super::{Call, u32_of};
use crate::graph::{Graph, Node};
use crate::op::{Op, Sampling};
use crate::plan::Plan;

/// The call of `node`, which is one of them.
pub(super) fn lower(plan: &Plan, node: &Node) -> Result<Call, KernelError> {
    let (graph, caps, outputs) = (&plan.graph, &plan.caps, &node.outputs);
    let n = |v: usize| u32_of(node.op.name(), v);
    let y = outputs[0];
    let (args, dispatches) = match &node.op {
        Op::TokenExpand { q, scale, shift, alpha, kappa } => {
            let spec = TokenExpand {
                m: n(graph.shape(*q).rows())?,
                d: n(graph.shape(*q).width())?,
                times: n(graph.shape(*shift).rows())?,
                scale: scale.is_some(),
                alpha: alpha.is_some(),
                kappa: kappa.is_some(),
            };
            (smallvec![Some(*q), *scale, Some(*shift), *alpha, *kappa, Some(y)], spec.record(caps)?)
        }
        Op::FieldScatter { z, index, rest } => {
            let (from, to) = (graph.shape(*z), graph.shape(y));
            let spec =
                FieldScatter { sources: n(to[0])?, times: n(to[1])?, k: n(from[2])?, cells: n(to[2])?, c: n(to[3])? };
            (smallvec![Some(*z), Some(*index), Some(*rest), Some(y)], spec.record(caps)?)
        }
        Op::DeformSample(s) => {
            let spec = sample(graph, s)?;
            let args = smallvec![Some(s.offsets), Some(s.weights), s.pixels, Some(s.field), Some(s.mask), Some(y)];
            (args, spec.record(caps)?)
        }
        Op::TrajApply { tau, points, when, motion } => {
            let shape = graph.shape(y);
            let spec = TrajApply { n: n(shape[1])?, times: n(shape[0])?, motion: *motion };
            (smallvec![Some(*tau), Some(*points), Some(*when), Some(y), Some(outputs[1])], spec.record(caps)?)
        }
        Op::Trajectory(t) => {
            let s = &t.sampling;
            let spec = Trajectory { sample: sample(graph, s)?, nt: n(t.times)?, motion: t.motion };
            let inputs = [Some(s.offsets), Some(s.weights), s.pixels, Some(s.field), Some(s.mask), Some(t.points)];
            let mut args = inputs.into_iter().collect::<smallvec::SmallVec<_>>();
            args.push(Some(t.when));
            args.extend(outputs.iter().map(|v| Some(*v)));
            (args, spec.record(caps)?)
        }
        other => unreachable!("BUG: {} is lowered elsewhere", other.name()),
    };
    Ok(Call { args, dispatches })
}

/// The kernel's view of a checked [`Sampling`].
fn sample(graph: &Graph, s: &Sampling) -> Result<DeformSample, KernelError> {
    let n = |v: usize| u32_of("deform_sample", v);
    let field = graph.shape(s.field);
    Ok(DeformSample {
        n: n(graph.shape(s.weights).rows())?,
        width: n(s.image[1])?,
        height: n(s.image[0])?,
        hp: n(s.grid[0])?,
        wp: n(s.grid[1])?,
        levels: n(field[0])?,
        points: n(graph.shape(s.weights).width() / field[0])?,
        times: n(field[1])?,
        listed: s.pixels.is_some(),
    })
}
