//! Weights that change from run to run, in the layout that the products which read them want: made on the device before each use.

use omnix_kernels::{KernelError, WeightType, pack};

use crate::error::GraphError;
use crate::graph::storage::packed_shape;
use crate::graph::{Call, Graph, Operation, Parameter, Shape, Site, Value, Values, WeightForm};

/// A block of a tensor as the weights of a product.
#[derive(Clone, Debug)]
pub struct Pack {
    /// The whole tensor, in the order of the checkpoint.
    pub x: Value,
    /// The block of it.
    pub block: Parameter,
    /// What reads it.
    pub form: WeightForm,
    /// How numbers are stored: f32, or f16 for half the bytes where x has the numbers in full.
    pub storage: WeightType,
}

impl<O: Operation + From<Pack>> Graph<O> {
    /// A block of the tensor `x` as the weights of a product: a value of the block's shape, stored as `form` and `storage` say.
    ///
    /// # Errors
    /// When `x` is not the whole tensor, or numbers shall be stored as int8.
    pub fn pack(
        &mut self,
        x: Value,
        block: Parameter,
        form: WeightForm,
        storage: WeightType,
    ) -> Result<Value, GraphError> {
        self.expect("pack", x, &block.full)?;
        let shape = block.shape();
        if storage == WeightType::I8 {
            let reason = "weights in training are stored as f32 or f16".to_owned();
            return Err(GraphError::Arguments { op: "pack", reason });
        }
        let words = packed_shape(&shape, form, storage).bytes() as usize / 4;
        let value = self.push_one(Pack { x, block, form, storage }, shape);
        let info = self.info_mut(value);
        info.physical = Shape::from([words]);
        info.stored = storage;
        Ok(value)
    }
}

impl Operation for Pack {
    fn name(&self) -> &'static str {
        "pack"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        self.x = map(self.x);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let shape = self.block.shape();
        let (start, row) = self.block.place();
        let order = self.form.order(&shape, (site.n(start)?, site.n(row)?));
        let weights = packed_shape(&shape, self.form, self.storage);
        let elements = site.n(site.values.shape(self.x).elements())?;
        let spec = pack::Pack { weights, order, elements, winograd: self.form.is_winograd() };
        site.call([Some(self.x), Some(site.outputs[0])], spec.record(site.caps)?)
    }

    fn flops(&self, _: &Values, _: &[Value]) -> u64 {
        0
    }

    fn windowed(&self, outputs: &[Value]) -> smallvec::SmallVec<[Value; 2]> {
        smallvec::smallvec![outputs[0]]
    }
}
