//! Gradient of a map that was resized.

use omnix_kernels::resize::{Corners, Filter};
use omnix_kernels::{KernelError, resize, resize_grad};

use crate::error::GraphError;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// `[f, h, w, c]` back to the height and width it had.
#[derive(Clone, Debug)]
pub struct ResizeGrad {
    /// Gradient of the resized map.
    pub dy: Value,
    /// Bilinear or bicubic.
    pub filter: Filter,
    /// Where the corners went.
    pub corners: Corners,
}

impl<O: Operation + From<ResizeGrad>> Graph<O> {
    /// Gradient of a map of `rows × columns` from the gradient `dy` of what it was resized to.
    ///
    /// # Errors
    /// When `dy` is not a map, or the sizes are 0.
    pub fn resize_grad(
        &mut self,
        dy: Value,
        [rows, columns]: [usize; 2],
        filter: Filter,
        corners: Corners,
    ) -> Result<Value, GraphError> {
        let [frames, _, _, channels] = self.map_dims("resize_grad", dy)?;
        if rows * columns == 0 {
            return Err(self.misfit("resize_grad", dy, "a map that was at least one pixel large"));
        }
        Ok(self.push_one(ResizeGrad { dy, filter, corners }, [frames, rows, columns, channels]))
    }
}

impl Operation for ResizeGrad {
    fn name(&self) -> &'static str {
        "resize_grad"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.dy = map(self.dy);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (dy, dx) = (site.values.shape(self.dy), site.values.shape(site.outputs[0]));
        let resize = resize::Resize {
            frames: site.n(dx[0])?,
            hi: site.n(dx[1])?,
            wi: site.n(dx[2])?,
            ho: site.n(dy[1])?,
            wo: site.n(dy[2])?,
            c: site.n(dx[3])?,
            filter: self.filter,
            corners: self.corners,
            code: false,
        };
        site.call([Some(self.dy), Some(site.outputs[0])], resize_grad::ResizeGrad { resize }.record(site.caps)?)
    }

    fn flops(&self, values: &Values, _: &[Value]) -> u64 {
        8 * values.shape(self.dy).elements() as u64
    }
}
