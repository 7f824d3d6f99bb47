//! What a rule is, and where gradients are added up.

use smallvec::SmallVec;

use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::Graph;

/// The derivative of an operation.
pub(super) trait Rule {
    /// Records the gradients of the inputs that [`Gradients::wants`], and adds them there.
    ///
    /// # Errors
    /// When a gradient would be larger than kernels take; a shape that does not fit is our own mistake.
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError>;

    /// Whether a gradient passes to this input; it is a constant to it otherwise.
    fn passes_to(&self, input: Value) -> bool {
        let _ = input;
        true
    }
}

/// A node as its rule sees it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Made<'a> {
    /// Its results.
    pub(super) outputs: &'a [Value],
    /// The gradients of those that the loss depends on: at least one.
    pub(super) gradients: &'a [Option<Value>],
}

impl Made<'_> {
    /// The first result, and its gradient where the loss depends on it.
    pub(super) fn first(&self) -> (Value, Option<Value>) {
        (self.outputs[0], self.gradients[0])
    }
}

/// The gradients of values: which are wanted, and the parts of them that rules have found, from the last node to the first. Their sum
/// goes in this order.
#[derive(Clone, Debug)]
pub(super) struct Gradients {
    wanted: Vec<bool>,
    parts: Vec<SmallVec<[Value; 2]>>,
}

impl Gradients {
    /// None yet; `wanted` by value.
    pub(super) fn new(wanted: Vec<bool>) -> Self {
        let parts = vec![SmallVec::new(); wanted.len()];
        Self { wanted, parts }
    }

    /// Whether anything depends on this gradient.
    pub(super) fn wants(&self, value: Value) -> bool {
        self.wanted.get(value.0 as usize).is_some_and(|wanted| *wanted)
    }

    /// As [`Gradients::wants`], of a value that may be absent.
    pub(super) fn wants_some(&self, value: Option<Value>) -> bool {
        value.is_some_and(|value| self.wants(value))
    }

    /// Adds a part of the gradient of `value`, if that is wanted. `part` has the value's elements in its order, under any shape.
    pub(super) fn add(&mut self, graph: &mut Graph, value: Value, part: Value) -> Result<(), GraphError> {
        if self.wants(value) {
            let shape = graph.shape(value).clone();
            let part = if *graph.shape(part) == shape { part } else { graph.reshape(part, shape)? };
            self.parts[value.0 as usize].push(part);
        }
        Ok(())
    }

    /// Takes the parts of a value's gradient; none where the loss does not depend on the value.
    pub(super) fn take(&mut self, value: Value) -> SmallVec<[Value; 2]> {
        self.parts.get_mut(value.0 as usize).map(std::mem::take).unwrap_or_default()
    }
}
