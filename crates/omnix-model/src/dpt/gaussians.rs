//! The Gaussian head (`spec/da3.md` section 11): a chain as the dense head's without its norm, on the same features, to which the picture
//! itself is added at its own size, and 38 numbers a pixel.
//!
//! `x = resize(neck) + merger(picture)`, merger: three 3×3 convolutions with GELU after each; UV code; 3×3, ReLU, 1×1.

use omnix_geometry::GAUSSIAN_NUMBERS;
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::{Head, uv};
use crate::config::GaussianConfig;
use crate::layers::{conv3, gelu, pointwise_conv};

/// Channels before the last 1×1 convolution.
const HIDDEN: usize = 32;

impl Head {
    /// The input `pictures` and the output `gaussians` of the frames of this head.
    pub(super) fn gaussians(
        &self,
        g: &mut Graph,
        config: &GaussianConfig,
        features: [Value; 4],
    ) -> Result<(Value, Value), GraphError> {
        let head = Self {
            at: Scope::root().pp("gs_head"),
            label: "gs_head",
            norm: false,
            // In the projections; at the picture's size the code comes after the picture.
            coded: true,
            features: config.features,
            channels: config.channels,
            ..self.clone()
        };
        let [height, width] = head.picture();
        let levels = head.pyramid(g, features)?;
        let fused = head.fuse(g, levels, "")?;
        let x = Self { coded: false, ..head.clone() }.enlarged(g, fused)?;

        let pictures = g.input("pictures", [head.frames, 3, height, width]);
        let mut seen = g.permute(pictures, &[0, 2, 3, 1])?;
        for (layer, part) in [(0, 8), (2, 4), (4, 2)] {
            seen = conv3(g, &head.at.pp("images_merger").pp(layer), seen, head.features / part, 1)?;
            seen = gelu(g, seen);
        }
        let x = g.add_values(x, seen)?;
        let x = uv::coded(g, x, (height, width), head.picture())?;
        let x = head.last_but_one(g, "output_conv2", x, HIDDEN)?;
        let numbers = pointwise_conv(g, &head.at.pp("scratch.output_conv2.2"), x, GAUSSIAN_NUMBERS)?;
        g.output(numbers, "gaussians");
        Ok((pictures, numbers))
    }
}
