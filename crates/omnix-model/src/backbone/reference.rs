//! The order of views inside the network: the reference first (`spec/da3.md` 4.5 and 5).
//!
//! Three or more views without given cameras are put in the order `[ref, 0, 1, .., ref-1, ref+1, ..]` just before block
//! `alternate_from - 1`; features and camera tokens return to the original order.

use omnix_graph::ops::Piece;
use omnix_graph::{Graph, GraphError, Value};

use super::spec::{BackboneSpec, Reference, ReferenceChoice, strategy};
use crate::config::{Family, NetworkConfig};

/// Views from this number on have a reference to choose.
const FEWEST: usize = 3;

/// How the views are ordered.
#[derive(Clone, Copy, Debug)]
pub(super) struct Order {
    views: usize,
    kind: Kind,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// This view first; 0 leaves the order as it is.
    Known(usize),
    /// Chosen by the network: u32 values.
    Selected { order: Value, inverse: Value, reference: Value },
}

impl Order {
    /// Nothing moved.
    pub(super) fn original(views: usize) -> Self {
        Self { views, kind: Kind::Known(0) }
    }

    /// The order that `spec` asks for, by the class tokens of `x` where the network decides.
    pub(super) fn choose(
        g: &mut Graph,
        config: &NetworkConfig,
        spec: &BackboneSpec,
        x: Value,
    ) -> Result<Self, GraphError> {
        let views = spec.images;
        if views < FEWEST || spec.cameras_given || config.family == Family::OmniX {
            return Ok(Self::original(views));
        }
        let kind = match (spec.reference, strategy(spec.reference)) {
            (_, Some(strategy)) => {
                let c = g.shape(x).width();
                let strides = vec![spec.tokens() * c, 1];
                let rows = Piece { value: x, dims: vec![views, c], start: 0, strides, at: vec![0, 0] };
                let class = g.assemble([views, c], &[rows])?;
                let (order, inverse, reference) = g.reference_view(class, strategy)?;
                g.output(reference, "ref.index");
                Kind::Selected { order, inverse, reference }
            }
            (ReferenceChoice::Middle, _) => Kind::Known(views / 2),
            (ReferenceChoice::Forced(i), _) => Kind::Known(i),
            (_, None) => Kind::Known(0),
        };
        Ok(Self { views, kind })
    }

    /// Which view is the reference.
    pub(super) fn reference(&self) -> Reference {
        match self.kind {
            Kind::Known(i) => Reference::Known(i),
            Kind::Selected { reference, .. } => Reference::Selected(reference),
        }
    }

    /// From the original order to the internal one; the leading dimension of `x` is views times something.
    pub(super) fn apply(&self, g: &mut Graph, x: Value) -> Result<Value, GraphError> {
        match self.kind {
            Kind::Known(0) => Ok(x),
            // Source ranges in the order of the result.
            Kind::Known(i) => self.moved(g, x, &[(i, 1), (0, i), (i + 1, self.views - i - 1)]),
            Kind::Selected { order, .. } => self.gathered(g, x, order),
        }
    }

    /// Back to the original order.
    pub(super) fn undo(&self, g: &mut Graph, x: Value) -> Result<Value, GraphError> {
        match self.kind {
            Kind::Known(0) => Ok(x),
            Kind::Known(i) => self.moved(g, x, &[(1, i), (0, 1), (i + 1, self.views - i - 1)]),
            Kind::Selected { inverse, .. } => self.gathered(g, x, inverse),
        }
    }

    /// `x` put together from ranges (first view, count) of views.
    fn moved(&self, g: &mut Graph, x: Value, ranges: &[(usize, usize)]) -> Result<Value, GraphError> {
        let shape = g.shape(x).clone();
        let row = shape.elements() / self.views;
        let mut at = 0;
        let pieces: Vec<Piece> = ranges
            .iter()
            .map(|&(first, count)| {
                let to = vec![at, 0];
                at += count;
                Piece { value: x, dims: vec![count, row], start: first * row, strides: vec![row, 1], at: to }
            })
            .collect();
        let moved = g.assemble([self.views, row], &pieces)?;
        g.reshape(moved, shape)
    }

    fn gathered(&self, g: &mut Graph, x: Value, index: Value) -> Result<Value, GraphError> {
        let shape = g.shape(x).clone();
        let rows = g.reshape(x, [self.views, shape.elements() / self.views])?;
        let moved = g.gather(rows, index)?;
        g.reshape(moved, shape)
    }
}
