//! A fusion chain from the coarsest map to the finest (`spec/da3.md` section 6, step 3).
//!
//! `y = y + RCU1(side)` (not in the coarsest step), `y = RCU2(y)`, 1×1 convolution, bilinear to the next size, with
//! `RCU(v) = v + conv2(relu(conv1(relu v)))`. The published order is resize, then 1×1; the weights of bilinear sampling
//! sum to 1, so the two commute, and before the resize there is a quarter of the work (section 17).

use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::Head;
use crate::layers::{conv3, pointwise_conv, relu, resize};

impl Head {
    /// The main chain (`suffix` empty) or the ray branch's (`_aux`): `[frames, 8gh, 8gw, F]`.
    pub(crate) fn fuse(&self, g: &mut Graph, levels: [Value; 4], suffix: &str) -> Result<Value, GraphError> {
        let mut fused: Option<Value> = None;
        for k in (0..4).rev() {
            let step = self.at.pp("scratch").pp(format_args!("refinenet{}{suffix}", k + 1));
            let y = match fused {
                None => levels[k],
                Some(coarser) => {
                    let side = unit(g, &step.pp("resConfUnit1"), levels[k])?;
                    g.add_values(side, coarser)?
                }
            };
            let y = unit(g, &step.pp("resConfUnit2"), y)?;
            let y = pointwise_conv(g, &step.pp("out_conv"), y, self.features)?;
            let (rows, columns) = match k {
                0 => self.fine(),
                _ => (g.shape(levels[k - 1])[1], g.shape(levels[k - 1])[2]),
            };
            let y = resize(g, y, rows, columns)?;
            fused = Some(g.name(y, &format!("{}.fuse{}{suffix}", self.label, k + 1)));
        }
        Ok(fused.unwrap_or(levels[0]))
    }
}

/// `v + conv2(relu(conv1(relu v)))`.
fn unit(g: &mut Graph, at: &Scope, v: Value) -> Result<Value, GraphError> {
    let channels = g.shape(v).width();
    let x = relu(g, v);
    let x = conv3(g, &at.pp("conv1"), x, channels, 1)?;
    let x = relu(g, x);
    let x = conv3(g, &at.pp("conv2"), x, channels, 1)?;
    g.add_values(x, v)
}
