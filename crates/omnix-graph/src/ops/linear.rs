//! `y = residual + gamma · act(x Wᵀ + bias)`: rows × depth by depth × columns.

use omnix_kernels::{Activation, KernelError, WeightType, linear};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::storage::{packed_shape, stored_as};
use crate::graph::{Access, Call, Graph, Operation, Packing, RowWise, Site, Value, Values, WeightForm};

/// A matrix product with its epilogue.
#[derive(Clone, Debug)]
pub struct Linear {
    /// `[.., k]`.
    pub x: Value,
    /// A parameter of `form`.
    pub w: Value,
    /// How `w` is packed.
    pub form: WeightForm,
    /// `[n]`.
    pub bias: Option<Value>,
    /// Fused activation.
    pub act: Activation,
    /// Fused layer scale `[n]`.
    pub gamma: Option<Value>,
    /// Fused addition, of the output's shape.
    pub residual: Option<Value>,
}

impl<O: Operation + From<Linear>> Graph<O> {
    /// `x [.., k] · wᵀ + bias` with `w [n, k]`, `bias [n]`: `[.., n]`. The kernel `[n, channels, rows, columns]` of a
    /// convolution will do where each row of `x` is what it covers, in this order.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn linear(&mut self, x: Value, w: Value, bias: Option<Value>) -> Result<Value, GraphError> {
        let k = self.shape(x).width();
        let n = match &**self.shape(w) {
            [n, rest @ ..] if !rest.is_empty() && rest.iter().product::<usize>() == k => *n,
            _ => return Err(self.misfit("linear", w, format!("[n, {k}]"))),
        };
        self.linear_of(x, w, WeightForm::Linear, n, bias)
    }

    /// A product of `n` columns with weights of any form.
    pub(crate) fn linear_of(
        &mut self,
        x: Value,
        w: Value,
        form: WeightForm,
        n: usize,
        bias: Option<Value>,
    ) -> Result<Value, GraphError> {
        if let Some(bias) = bias {
            let wanted = if form == WeightForm::ConvTranspose { self.shape(bias).elements() } else { n };
            self.expect("linear", bias, &[wanted])?;
        }
        let shape = self.shape(x).with_width(n);
        let op = Linear { x, w, form, bias, act: Activation::None, gamma: None, residual: None };
        Ok(self.push_one(op, shape))
    }
}

impl Operation for Linear {
    fn name(&self) -> &'static str {
        "linear"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { x, w, bias, gamma, residual, .. } = self;
        map_all([x, w].into_iter().chain(bias).chain(gamma).chain(residual), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        debug_assert!(
            self.form != WeightForm::Conv && !self.form.is_winograd(),
            "BUG: a linear layer with a convolution's weights"
        );
        let storage = stored_as(site.values, self.w, site.storage);
        let spec = linear::Linear {
            m: site.rows(self.x)?,
            weights: packed_shape(site.values.shape(self.w), self.form, storage),
            act: self.act,
            bias: self.bias.is_some(),
            gamma: self.gamma.is_some(),
            residual: self.residual.is_some(),
        };
        let args = [Some(self.x), Some(self.w), self.bias, self.gamma, self.residual, Some(site.outputs[0])];
        site.call(args, spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        2 * values.shape(outputs[0]).elements() as u64 * values.shape(self.x).width() as u64
    }

    fn row_wise(&self, values: &Values) -> Option<RowWise> {
        let whole = 1 + usize::from(self.bias.is_some()) + usize::from(self.gamma.is_some());
        let mut row_wise = RowWise::new(values.shape(self.x).rows(), 1, 1, whole);
        row_wise.inputs.extend(self.residual.map(|_| Access::Rows));
        Some(row_wise)
    }

    fn packing(&self, values: &Values, value: Value, storage: WeightType) -> Packing {
        if value == self.w {
            Packing::Matrix(self.form, stored_as(values, value, storage))
        } else if self.form == WeightForm::ConvTranspose && self.bias == Some(value) {
            Packing::Repeat(values.shape(self.w)[2..].iter().product())
        } else {
            Packing::Plain
        }
    }
}
