//! From a graph that computes a loss to one that also computes the loss' gradient.
//!
//! Reverse mode, from graph to graph and before fusion: values are visited from the last to the first, and every operation's rule (a
//! file by the operation's name) records what its inputs' gradients are. What the rules record is planned, fused and run like
//! anything else. Every sum has one order, so that a gradient has the same bits in every run.

mod attention;
mod copy;
mod feed_forward;
mod gather;
mod gradients;
mod layer_norm;
mod linear;
mod motion;
mod pointwise;
mod reduce;
mod resize;
mod softmax;

use gradients::{Gradients, Made, Rule};

use crate::error::GraphError;
use crate::graph::{Operation as _, Source, Value};
use crate::ops::{Graph, Node, Op};

impl Graph {
    /// Records the gradient of `loss`, a single number, with respect to each of `leaves` (inputs or parameters); `None` for a leaf that
    /// the loss does not depend on.
    ///
    /// # Errors
    /// When `loss` is not one number, a value that the gradient has to pass is made by an operation without a derivative, or
    /// a gradient is larger than kernels take.
    pub fn differentiate(&mut self, loss: Value, leaves: &[Value]) -> Result<Vec<Option<Value>>, GraphError> {
        if self.shape(loss).elements() != 1 {
            return Err(self.misfit("differentiate", loss, "one number"));
        }
        let one = self.constant("gradient.loss", self.shape(loss).clone(), vec![1.0]);
        self.differentiate_from(&[(loss, one)], leaves)
    }

    /// As [`Graph::differentiate`], from values whose gradients are given.
    ///
    /// # Errors
    /// As there, and when a gradient does not have its value's elements.
    pub fn differentiate_from(
        &mut self,
        given: &[(Value, Value)],
        leaves: &[Value],
    ) -> Result<Vec<Option<Value>>, GraphError> {
        let first = if self.derived.is_empty() { self.count() as u32 } else { self.derived.start };
        let reached = reached(self, leaves);
        let mut sums: Vec<Option<Value>> = vec![None; self.count()];
        for node in self.nodes.iter_mut().filter(|node| reached[node.outputs[0].0 as usize]) {
            prepare(&mut node.op);
        }
        let mut gradients = Gradients::new(reached);
        for (value, gradient) in given {
            gradients.add(self, *value, *gradient)?;
        }
        for index in (0..sums.len()).rev() {
            let value = Value(index as u32);
            let parts = gradients.take(value);
            let parts = copy::joined(self, &parts)?;
            sums[index] = self.sum(&parts)?;
            match (&self.info(value).source, sums[index]) {
                (Source::Reshape(x), Some(sum)) => {
                    let x = *x;
                    gradients.add(self, x, sum)?;
                }
                (Source::StraightThrough { gradient: Some(gradient), .. }, Some(sum)) => {
                    let to = *gradient;
                    gradients.add(self, to, sum)?;
                }
                // A node is differentiated at the first of its results, when what reads the others has been.
                (Source::Node(node), _) if self.nodes[*node].outputs.first() == Some(&value) => {
                    let Node { op, outputs } = self.nodes[*node].clone();
                    let given: Vec<Option<Value>> = outputs.iter().map(|v| sums[v.0 as usize]).collect();
                    if given.iter().any(Option::is_some) {
                        let rule = rule(&op).ok_or_else(|| GraphError::NotDifferentiable { op: op.name() })?;
                        rule.differentiate(self, &Made { outputs: &outputs, gradients: &given }, &mut gradients)?;
                    }
                }
                _ => {}
            }
        }
        self.derived = first..self.count() as u32;
        Ok(leaves.iter().map(|leaf| sums[leaf.0 as usize]).collect())
    }

    /// The sum of `parts` in their order.
    fn sum(&mut self, parts: &[Value]) -> Result<Option<Value>, GraphError> {
        let Some((first, rest)) = parts.split_first() else { return Ok(None) };
        if let Some(padded) = rest.iter().find(|part| self.info(**part).physical != *self.shape(**part)) {
            // Sums go over the numbers of a shape, and heads lie padded.
            return Err(self.misfit("differentiate", *padded, "heads that one attention reads"));
        }
        rest.iter().try_fold(*first, |sum, part| self.add_values(sum, *part)).map(Some)
    }
}

/// Which values a gradient reaches on its way back to `leaves`: those, and all that is made from them, as far as operations pass
/// gradients on.
fn reached(graph: &Graph, leaves: &[Value]) -> Vec<bool> {
    let mut wanted = vec![false; graph.count()];
    leaves.iter().for_each(|leaf| wanted[leaf.0 as usize] = true);
    for (value, info) in graph.values() {
        wanted[value.0 as usize] |= match info.source {
            Source::Reshape(x) => wanted[x.0 as usize],
            Source::StraightThrough { gradient, .. } => gradient.is_some_and(|to| wanted[to.0 as usize]),
            Source::Node(node) => {
                let op = &graph.nodes[node].op;
                let passes_to = |input| rule(op).is_none_or(|rule| rule.passes_to(input));
                !is_choice(op) && op.inputs().into_iter().any(|input| wanted[input.0 as usize] && passes_to(input))
            }
            Source::Input | Source::Parameter(_) | Source::Constant(_) => false,
        };
    }
    wanted
}

/// The rule of an operation; none where there is no derivative that training uses: of what chooses, of gradients themselves.
fn rule(op: &Op) -> Option<&dyn Rule> {
    Some(match op {
        Op::Linear(op) => op,
        Op::Conv2d(op) => op,
        Op::LayerNorm(op) => op,
        Op::SplitHeads(op) => op,
        Op::Attention(op) => op,
        Op::Resize(op) => op,
        Op::Copies(op) => op,
        Op::Map(op) => op,
        Op::Zip(op) => op,
        Op::Select(op) => op,
        Op::SwiGlu(op) => op,
        Op::Softmax(op) => op,
        Op::Reduce(op) => op,
        Op::Gather(op) => op,
        Op::Scatter(op) => op,
        Op::TokenExpand(op) => op,
        Op::FieldScatter(op) => op,
        Op::DeformSample(op) => op,
        Op::TrajApply(op) => op,
        Op::Dropout(op) => op,
        _ => return None,
    })
}

/// Changes an operation where its rule needs it to leave more than its result.
fn prepare(op: &mut Op) {
    if let Op::Attention(attention) = op {
        attention.keep_state = true;
    }
}

/// Whether an operation chooses: its result changes in steps, and no gradient passes. What is trained around it says so by
/// [`Graph::straight_through`].
fn is_choice(op: &Op) -> bool {
    matches!(op, Op::TopK(_) | Op::ReferenceView(_))
}
