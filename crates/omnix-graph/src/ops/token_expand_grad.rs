//! The gradient of [`super::TokenExpand`]: of the tokens, of the numbers of each token, and of the rows of each time.

use omnix_kernels::{KernelError, token_expand_grad};

use super::token_expand::{Expand, check};
use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// The gradient of tokens under a code of each time.
#[derive(Clone, Debug)]
pub struct TokenExpandGrad {
    /// `[.., d]`.
    pub q: Value,
    /// `[T, d]`.
    pub shift: Value,
    /// The optional parts.
    pub parts: Expand,
    /// Gradient of the result, `[T, m, d]`.
    pub dz: Value,
}

/// What [`Graph::token_expand_grad`] gives.
#[derive(Clone, Copy, Debug)]
pub struct ExpandGrad {
    /// Of the tokens, in their shape.
    pub q: Value,
    /// Of alpha and kappa, `[m, 2]`.
    pub rows: Value,
    /// Of scale and shift, `[T, 2, d]`.
    pub times: Value,
}

impl<O: Operation + From<TokenExpandGrad>> Graph<O> {
    /// The gradient of [`Graph::token_expand`] with the same arguments. What is absent has the value 0 (scale) or 1, and its
    /// gradient is that at this value.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn token_expand_grad(
        &mut self,
        q: Value,
        shift: Value,
        parts: Expand,
        dz: Value,
    ) -> Result<ExpandGrad, GraphError> {
        let op = "token_expand_grad";
        let [times, m, d] = check(self, op, (q, shift, parts))?;
        self.expect(op, dz, &[times, m, d])?;
        let grad = TokenExpandGrad { q, shift, parts, dz };
        let blocks = grad.spec(self)?.blocks() as usize;
        let shapes = [
            self.shape(q).clone(),
            Shape::from([m, 2]),
            Shape::from([times, 2, d]),
            Shape::from([m, 3, d]),
            Shape::from([times, blocks, 2, d]),
        ];
        let outputs = self.push(grad, shapes);
        Ok(ExpandGrad { q: outputs[0], rows: outputs[1], times: outputs[2] })
    }
}

impl TokenExpandGrad {
    /// The kernel's view of it.
    fn spec(&self, values: &Values) -> Result<token_expand_grad::TokenExpandGrad, KernelError> {
        let n = |n: usize| u32_of("token_expand_grad", n);
        let Expand { scale, alpha, kappa } = self.parts;
        Ok(token_expand_grad::TokenExpandGrad {
            m: n(values.shape(self.q).rows())?,
            d: n(values.shape(self.q).width())?,
            times: n(values.shape(self.shift).rows())?,
            scale: scale.is_some(),
            alpha: alpha.is_some(),
            kappa: kappa.is_some(),
        })
    }
}

impl Operation for TokenExpandGrad {
    fn name(&self) -> &'static str {
        "token_expand_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { q, shift, parts: Expand { scale, alpha, kappa }, dz } = self;
        map_all([q, shift, dz].into_iter().chain(scale).chain(alpha).chain(kappa), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Expand { scale, alpha, kappa } = self.parts;
        let inputs = [Some(self.q), scale, Some(self.shift), alpha, kappa, Some(self.dz)];
        let args = inputs.into_iter().chain(site.outputs.iter().copied().map(Some));
        site.call(args, self.spec(site.values)?.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        12 * values.shape(self.dz).elements() as u64
    }
}
