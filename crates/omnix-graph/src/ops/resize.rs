//! A map at another height and width, plus an optional code of columns and rows.

use omnix_kernels::resize::{Corners, Filter};
use omnix_kernels::{KernelError, resize};

use crate::error::GraphError;
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Site, Value, Values};

/// `[f, h, w, c]` to another height and width.
#[derive(Clone, Debug)]
pub struct Resize {
    /// Input map.
    pub x: Value,
    /// Bilinear or bicubic.
    pub filter: Filter,
    /// Where the corners go.
    pub corners: Corners,
    /// Added to every frame: `[w + h, c/2]`, see `omnix_kernels::resize`.
    pub code: Option<Value>,
}

impl<O: Operation + From<Resize>> Graph<O> {
    /// To `rows × columns`.
    ///
    /// # Errors
    /// When `x` is not a map.
    pub fn resize(
        &mut self,
        x: Value,
        rows: usize,
        columns: usize,
        filter: Filter,
        corners: Corners,
    ) -> Result<Value, GraphError> {
        self.resize_coded(x, [rows, columns], filter, corners, None)
    }

    /// [`Graph::resize`] to `[rows, columns]`, plus a code whose first half of channels depends on the column alone and whose second
    /// half on the row: `code` is `[columns + rows, c/2]`, columns first.
    ///
    /// # Errors
    /// When `x` is not a map, or the code has another shape.
    pub fn resize_coded(
        &mut self,
        x: Value,
        [rows, columns]: [usize; 2],
        filter: Filter,
        corners: Corners,
        code: Option<Value>,
    ) -> Result<Value, GraphError> {
        let [frames, _, _, channels] = self.map_dims("resize", x)?;
        if let Some(code) = code {
            if !channels.is_multiple_of(2) {
                return Err(self.misfit("resize", x, "[frames, rows, columns, an even number of channels]"));
            }
            self.expect("resize", code, &[columns + rows, channels / 2])?;
        }
        Ok(self.push_one(Resize { x, filter, corners, code }, [frames, rows, columns, channels]))
    }
}

impl Operation for Resize {
    fn name(&self) -> &'static str {
        "resize"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.x].into_iter().chain(&mut self.code), map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let (from, to) = (site.values.shape(self.x), site.values.shape(site.outputs[0]));
        let spec = resize::Resize {
            frames: site.n(from[0])?,
            hi: site.n(from[1])?,
            wi: site.n(from[2])?,
            ho: site.n(to[1])?,
            wo: site.n(to[2])?,
            c: site.n(from[3])?,
            filter: self.filter,
            corners: self.corners,
            code: self.code.is_some(),
        };
        site.call([Some(self.x), self.code, Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        8 * values.shape(outputs[0]).elements() as u64
    }
}
