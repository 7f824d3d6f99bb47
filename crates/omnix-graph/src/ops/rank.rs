//! The number of a given rank, or a quantile, of each row.

use omnix_kernels::KernelError;
use omnix_kernels::rank::{self, Which};

use crate::error::{GraphError, u32_of};
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// The number of a rank among those of each row that are not NaN.
#[derive(Clone, Debug)]
pub struct Rank {
    /// `[rows, n]`.
    pub x: Value,
    /// The wanted rank.
    pub which: Which,
}

impl<O: Operation + From<Rank>> Graph<O> {
    /// The number of the wanted rank of each row of `x [rows, n]`, among those that are not NaN: `[rows]`, NaN where there is none.
    ///
    /// # Errors
    /// When `x` is not a matrix, or a quantile is not from 0 to 1.
    pub fn rank(&mut self, x: Value, which: Which) -> Result<Value, GraphError> {
        let [rows, n] = **self.shape(x) else { return Err(self.misfit("rank", x, "[rows, n]")) };
        if let Which::Quantile { numerator, denominator } = which
            && (denominator == 0 || numerator > denominator)
        {
            let reason = format!("quantile {numerator}/{denominator}; it is from 0 to 1");
            return Err(GraphError::Arguments { op: "rank", reason });
        }
        let blocks = spec([rows, n], which)?.blocks() as usize;
        let shapes = [Shape::from([rows]), Shape::from([rows, 2]), Shape::from([rows, blocks, 4])];
        Ok(self.push(Rank { x, which }, shapes)[0])
    }
}

/// The kernel's view of it.
fn spec([rows, n]: [usize; 2], which: Which) -> Result<rank::Rank, KernelError> {
    Ok(rank::Rank { rows: u32_of("rank", rows)?, n: u32_of("rank", n)?, which })
}

impl Operation for Rank {
    fn name(&self) -> &'static str {
        "rank"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let shape = site.values.shape(self.x);
        let spec = spec([shape[0], shape[1]], self.which)?;
        let args = std::iter::once(self.x).chain(site.outputs.iter().copied()).map(Some);
        site.call(args, spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        values.shape(self.x).elements() as u64
    }
}
