//! Coloured points as a camera sees them: a picture.

use omnix_kernels::{KernelError, splat};

use crate::error::{GraphError, u32_of};
use crate::graph::operation::map_all;
use crate::graph::{Call, Graph, Operation, Shape, Site, Value, Values};

/// Points, how they look, and who looks: see `omnix_kernels::splat`.
#[derive(Clone, Copy, Debug)]
pub struct Splat {
    /// World positions `[n, 3]`.
    pub points: Value,
    /// Radii `[n]`, in units of the world; negative ones in pixels.
    pub sizes: Value,
    /// u32 `[n]`: red + 256 green + 65536 blue.
    pub colours: Value,
    /// The numbers of `omnix_kernels::splat::view`.
    pub view: Value,
    /// Height and width of the picture.
    pub size: [usize; 2],
    /// The largest radius in pixels.
    pub largest: u32,
}

impl<O: Operation + From<Splat>> Graph<O> {
    /// The picture `[height, width, 4]`: red, green, blue, each times cover, and cover, from 0 to 1.
    ///
    /// # Errors
    /// When a shape does not fit, or the picture has no pixels or too large a side.
    pub fn splat(&mut self, splat: &Splat) -> Result<Value, GraphError> {
        let op = "splat";
        let [n, 3] = **self.shape(splat.points) else { return Err(self.misfit(op, splat.points, "[n, 3]")) };
        self.expect(op, splat.sizes, &[n])?;
        self.expect(op, splat.colours, &[n])?;
        self.expect(op, splat.view, &[splat::VIEW_WORDS])?;
        let [height, width] = splat.size;
        let words = spec(op, n, splat)?.scratch_words() as usize;
        // The second and third are scratch.
        let shapes = [Shape::from([height, width, 4]), Shape::from([words]), Shape::from([words])];
        Ok(self.push(*splat, shapes)[0])
    }
}

/// As the kernel takes it.
fn spec(op: &'static str, n: usize, splat: &Splat) -> Result<splat::Splat, KernelError> {
    let [height, width] = splat.size;
    let spec = splat::Splat {
        n: u32_of(op, n)?,
        width: u32_of(op, width)?,
        height: u32_of(op, height)?,
        largest: splat.largest,
    };
    spec.check()?;
    Ok(spec)
}

impl Operation for Splat {
    fn name(&self) -> &'static str {
        "splat"
    }

    fn map_inputs(&mut self, map: &mut dyn FnMut(Value) -> Value) {
        map_all([&mut self.points, &mut self.sizes, &mut self.colours, &mut self.view], map);
    }

    fn lower(&self, site: &Site<'_>) -> Result<Vec<Call>, KernelError> {
        let n = site.values.shape(self.sizes).elements();
        let own = [self.points, self.sizes, self.colours, self.view];
        let args = own.into_iter().chain(site.outputs.iter().copied()).map(Some);
        site.call(args, spec("splat", n, self)?.record(site.caps)?)
    }

    fn flops(&self, values: &Values, outputs: &[Value]) -> u64 {
        // Projection in both passes, and discs of about a pixel.
        100 * values.shape(self.sizes).elements() as u64 + 10 * values.shape(outputs[0]).elements() as u64
    }
}
