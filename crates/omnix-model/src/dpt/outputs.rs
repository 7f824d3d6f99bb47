//! The ends of the heads (`spec/da3.md` section 6, steps 4 and 5, and section 7; clamps: `spec/omnix.md` 4.1).

use omnix_graph::ops::Unary;
use omnix_graph::{Graph, GraphError, Value};

use super::{Head, uv};
use crate::layers::{conv3, layer_norm, pointwise_conv, relu, resize};

/// Channels before the last 1×1 convolutions.
const HIDDEN: usize = 32;
/// Eps of the norm in the ray branch.
const AUX_EPS: f32 = 1e-5;
/// Direction and origin.
pub(super) const RAY: usize = 6;

impl Head {
    /// From the finest fused map to the picture's size, up to the last layer: `[frames, H, W, hidden]`.
    pub(crate) fn at_picture_size(&self, g: &mut Graph, fused: Value, hidden: usize) -> Result<Value, GraphError> {
        let x = self.enlarged(g, fused)?;
        self.last_but_one(g, "output_conv2", x, hidden)
    }

    /// The same without the two last layers: `[frames, H, W, F/2]`.
    pub(crate) fn enlarged(&self, g: &mut Graph, fused: Value) -> Result<Value, GraphError> {
        let (at, half, [height, width]) = (self.at.pp("scratch"), self.features / 2, self.picture());
        let neck = conv3(g, &at.pp("output_conv1"), fused, half, 1)?;
        g.name(neck, &format!("{}.neck", self.label));
        let x = match self.coded {
            true => uv::coded(g, neck, (height, width), self.picture())?,
            false => resize(g, neck, height, width)?,
        };
        Ok(g.name(x, &format!("{}.main.in", self.label)))
    }

    /// The first layer of the branch `branch`: `[frames, H, W, hidden]`.
    pub(super) fn last_but_one(
        &self,
        g: &mut Graph,
        branch: &str,
        x: Value,
        hidden: usize,
    ) -> Result<Value, GraphError> {
        let x = conv3(g, &self.at.pp("scratch").pp(branch).pp(0), x, hidden, 1)?;
        Ok(relu(g, x))
    }

    /// Outputs `depth` and `sky`, `[frames, H, W]`: one map at the picture's size, two branches.
    pub(super) fn depth_and_sky(&self, g: &mut Graph, fused: Value) -> Result<(Value, Value), GraphError> {
        let map = self.enlarged(g, fused)?;
        let mut logits = |branch: &str, name: &str| {
            let x = self.last_but_one(g, branch, map, HIDDEN)?;
            let x = pointwise_conv(g, &self.at.pp("scratch").pp(branch).pp(2), x, 1)?;
            Ok::<_, GraphError>(g.name(x, name))
        };
        let depth = logits("output_conv2", "head.main.logits")?;
        let sky = logits("sky_output_conv2", "head.sky.logits")?;
        let depth = self.exponential(g, depth, 0)?;
        g.output(depth, "depth");
        let shape = g.shape(depth).to_vec();
        let sky = g.reshape(sky, shape.as_slice())?;
        let sky = relu(g, sky);
        g.output(sky, "sky");
        Ok((depth, sky))
    }

    /// Outputs `depth` and `depth_conf`, `[frames, H, W]`.
    pub(super) fn main(&self, g: &mut Graph, fused: Value) -> Result<(Value, Value), GraphError> {
        let x = self.at_picture_size(g, fused, HIDDEN)?;
        let logits = pointwise_conv(g, &self.at.pp("scratch.output_conv2.2"), x, 2)?;
        g.name(logits, "head.main.logits");
        let depth = self.exponential(g, logits, 0)?;
        g.output(depth, "depth");
        let confidence = self.confidence(g, logits, 1)?;
        g.output(confidence, "depth_conf");
        Ok((depth, confidence))
    }

    /// Rays `[frames, 8gh, 8gw, 6]` and their confidence `[frames, 8gh, 8gw]`.
    pub(super) fn rays(&self, g: &mut Graph, fused: Value, convs: usize) -> Result<(Value, Value), GraphError> {
        let (at, features) = (self.at.pp("scratch"), self.features);
        let mut x = fused;
        // No activation between them; zero padding keeps them from being one convolution.
        for i in 0..convs {
            let out = if i % 2 == 0 { features / 2 } else { features };
            x = conv3(g, &at.pp("output_conv1_aux.3").pp(i), x, out, 1)?;
        }
        g.name(x, "head.neck_aux");
        let x = uv::coded(g, x, self.fine(), self.picture())?;
        g.name(x, "head.aux.in");
        let x = conv3(g, &at.pp("output_conv2_aux.3.0"), x, HIDDEN, 1)?;
        // One instance shared by the four levels; files hold it under level 0.
        let x = layer_norm(g, &at.pp("output_conv2_aux.0.2"), x, AUX_EPS)?;
        let x = relu(g, x);
        let logits = pointwise_conv(g, &at.pp("output_conv2_aux.3.5"), x, RAY + 1)?;
        g.name(logits, "head.aux.logits");
        let ray = g.slice(logits, 3, 0, RAY)?;
        let confidence = self.confidence(g, logits, RAY)?;
        Ok((ray, confidence))
    }

    /// `exp` of a channel, its exponent clamped where the network says so: `[frames, rows, columns]`.
    fn exponential(&self, g: &mut Graph, logits: Value, channel: usize) -> Result<Value, GraphError> {
        let shape = g.shape(logits)[..3].to_vec();
        let x = g.slice(logits, 3, channel, 1)?;
        let x = g.reshape(x, shape.as_slice())?;
        let op = match self.clamp {
            Some(limit) => Unary::ExpClamped { low: -limit, high: limit },
            None => Unary::Exp,
        };
        Ok(g.map(op, x))
    }

    /// `exp + 1` of a channel.
    pub(crate) fn confidence(&self, g: &mut Graph, logits: Value, channel: usize) -> Result<Value, GraphError> {
        let x = self.exponential(g, logits, channel)?;
        Ok(g.map(Unary::ScaleShift { s: 1.0, t: 1.0 }, x))
    }
}
