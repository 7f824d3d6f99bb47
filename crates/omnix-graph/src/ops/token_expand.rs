//! `z[t, r] = q[r] · (1 + alpha[r] · scale[t]) + kappa[r] · shift[t]`: every token once for every time.

use omnix_kernels::{KernelError, token_expand};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// Tokens under a code of each time.
#[derive(Clone, Debug)]
pub struct TokenExpand {
    /// `[m, d]`.
    pub q: Value,
    /// `[T, d]`, else 0.
    pub scale: Option<Value>,
    /// `[T, d]`.
    pub shift: Value,
    /// m numbers, else 1.
    pub alpha: Option<Value>,
    /// m numbers, else 1.
    pub kappa: Option<Value>,
}

/// The optional parts of [`Graph::token_expand`].
#[derive(Clone, Copy, Debug, Default)]
pub struct Expand {
    /// `[T, d]`; 0 where absent.
    pub scale: Option<Value>,
    /// One number per token for the scale; 1 where absent.
    pub alpha: Option<Value>,
    /// One number per token for the shift; 1 where absent.
    pub kappa: Option<Value>,
}

/// Checks the shapes; times, tokens and channels.
pub(super) fn check(
    values: &Values,
    op: &'static str,
    (q, shift, parts): (Value, Value, Expand),
) -> Result<[usize; 3], GraphError> {
    let (m, d) = (values.shape(q).rows(), values.shape(q).width());
    let times = match **values.shape(shift) {
        [times, width] if width == d => times,
        _ => return Err(values.misfit(op, shift, format!("[times, {d}]"))),
    };
    if let Some(scale) = parts.scale {
        values.expect(op, scale, &[times, d])?;
    }
    for value in [parts.alpha, parts.kappa].into_iter().flatten() {
        if values.shape(value).elements() != m {
            return Err(values.misfit(op, value, format!("one number for each of {m} tokens")));
        }
    }
    Ok([times, m, d])
}

impl<O: Operation + From<TokenExpand>> Graph<O> {
    /// `z[t, r] = q[r] · (1 + alpha[r] · scale[t]) + kappa[r] · shift[t]`: `[T, m, d]` of `q [.., d]` and `shift [T, d]`.
    ///
    /// # Errors
    /// When a shape does not fit.
    pub fn token_expand(&mut self, q: Value, shift: Value, parts: Expand) -> Result<Value, GraphError> {
        let [times, m, d] = check(self, "token_expand", (q, shift, parts))?;
        let Expand { scale, alpha, kappa } = parts;
        Ok(self.push_one(TokenExpand { q, scale, shift, alpha, kappa }, [times, m, d]))
    }
}

impl Operation for TokenExpand {
    fn name(&self) -> &'static str {
        "token_expand"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        let Self { q, scale, shift, alpha, kappa } = self;
        map_all([q, shift].into_iter().chain(scale).chain(alpha).chain(kappa), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let Self { q, scale, shift, alpha, kappa } = *self;
        let spec = token_expand::TokenExpand {
            m: site.n(site.values.shape(q).rows())?,
            d: site.width(q)?,
            times: site.n(site.values.shape(shift).rows())?,
            scale: scale.is_some(),
            alpha: alpha.is_some(),
            kappa: kappa.is_some(),
        };
        site.call([Some(q), scale, Some(shift), alpha, kappa, Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        4 * values.shape(outputs[0]).elements() as u64
    }
}
