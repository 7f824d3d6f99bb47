//! Four features to four maps of one width at four scales (`spec/da3.md` section 6, steps 1 and 2).

use omnix_graph::{Graph, GraphError, Value};

use super::{Head, uv};
use crate::layers::{conv_transpose, conv3, conv3_plain, layer_norm, pointwise_conv};

/// Eps of the norm shared by the four features.
const NORM_EPS: f32 = 1e-5;

impl Head {
    /// `feat.k` `[frames, P, 2C]` to `head.rn1..4`: 4, 2, 1 and a half times the patch grid (the last rounded up).
    pub(crate) fn pyramid(&self, g: &mut Graph, features: [Value; 4]) -> Result<[Value; 4], GraphError> {
        let mut levels = features;
        for (k, level) in levels.iter_mut().enumerate() {
            let map = self.projected(g, *level, k)?;
            let resize = self.at.pp("resize_layers").pp(k);
            let map = match k {
                0 => conv_transpose(g, &resize, map, 4)?,
                1 => conv_transpose(g, &resize, map, 2)?,
                2 => map,
                _ => conv3(g, &resize, map, self.channels[k], 2)?,
            };
            g.name(map, &format!("{}.resized{k}", self.label));
            let name = format!("layer{}_rn", k + 1);
            let map = conv3_plain(g, &self.at.pp("scratch").pp(name), map, self.features)?;
            *level = g.name(map, &format!("{}.rn{}", self.label, k + 1));
        }
        Ok(levels)
    }

    /// Norm, projection to the level's channels, UV code, as far as the head has them.
    fn projected(&self, g: &mut Graph, feature: Value, k: usize) -> Result<Value, GraphError> {
        let ((rows, columns), c) = (self.grid, self.channels[k]);
        let normed = if self.norm { layer_norm(g, &self.at.pp("norm"), feature, NORM_EPS)? } else { feature };
        let map = pointwise_conv(g, &self.at.pp("projects").pp(k), normed, c)?;
        g.name(map, &format!("{}.proj{k}", self.label));
        let map = g.reshape(map, [self.frames, rows, columns, c])?;
        if self.coded { uv::coded(g, map, self.grid, self.picture()) } else { Ok(map) }
    }
}
