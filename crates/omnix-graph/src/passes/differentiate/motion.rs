//! Gradients of what only the motion stages record: tokens for every time, fields, sampling, moved points.

use super::gradients::{Gradients, Made, Rule};
use crate::error::GraphError;
use crate::graph::Value;
use crate::ops::{DeformSample, Expand, FieldScatter, Graph, TokenExpand, TrajApply};

impl Rule for TokenExpand {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dz)) = node.first() else { return Ok(()) };
        let Self { q, scale, shift, alpha, kappa } = *self;
        let made = graph.token_expand_grad(q, shift, Expand { scale, alpha, kappa }, dz)?;
        gradients.add(graph, q, made.q)?;
        for (value, column) in [(alpha, 0), (kappa, 1)] {
            if let Some(value) = value.filter(|value| gradients.wants(*value)) {
                let part = graph.slice(made.rows, 1, column, 1)?;
                gradients.add(graph, value, part)?;
            }
        }
        for (value, row) in [(scale, 0), (Some(shift), 1)] {
            if let Some(value) = value.filter(|value| gradients.wants(*value)) {
                let part = graph.slice(made.times, 1, row, 1)?;
                gradients.add(graph, value, part)?;
            }
        }
        Ok(())
    }
}

impl Rule for FieldScatter {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dfield)) = node.first() else { return Ok(()) };
        let dz = graph.field_scatter_grad(dfield, self.index)?;
        gradients.add(graph, self.z, dz)
    }

    fn passes_to(&self, input: Value) -> bool {
        input == self.z
    }
}

impl Rule for DeformSample {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let (_, Some(dtau)) = node.first() else { return Ok(()) };
        let sampling = self.0;
        if gradients.wants(sampling.offsets) || gradients.wants(sampling.weights) {
            let (offsets, weights) = graph.deform_sample_grad(&sampling, dtau)?;
            gradients.add(graph, sampling.offsets, offsets)?;
            gradients.add(graph, sampling.weights, weights)?;
        }
        if gradients.wants(sampling.field) || gradients.wants(sampling.mask) {
            let (field, mask) = graph.deform_sample_grad_field(&sampling, dtau)?;
            gradients.add(graph, sampling.field, field)?;
            gradients.add(graph, sampling.mask, mask)?;
        }
        Ok(())
    }

    fn passes_to(&self, input: Value) -> bool {
        Some(input) != self.0.pixels
    }
}

impl Rule for TrajApply {
    fn differentiate(&self, graph: &mut Graph, node: &Made<'_>, gradients: &mut Gradients) -> Result<(), GraphError> {
        let Self { tau, points, when, motion } = *self;
        let dy = match node.gradients[0] {
            Some(dy) => dy,
            // The loss depends on the scores alone.
            None => graph.fill(graph.shape(node.outputs[0]).clone(), 0.0),
        };
        let (dtau, dpoints) = graph.traj_apply_grad((tau, points, when), motion, dy, node.gradients[1])?;
        gradients.add(graph, tau, dtau)?;
        gradients.add(graph, points, dpoints)
    }

    fn passes_to(&self, input: Value) -> bool {
        input != self.when
    }
}
