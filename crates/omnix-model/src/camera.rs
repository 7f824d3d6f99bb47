//! Cameras as nine numbers: from the features ([`decode`]) and into the network ([`encode`]); `spec/da3.md` section 8.
//!
//! A code is camera-to-world translation (3), quaternion xyzw (4, of any length), vertical and horizontal field of view.
//! What the numbers mean is `omnix_geometry`'s business.

use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use crate::block::{Block, Span};
use crate::config::{CameraEncoderConfig, FeedForward};
use crate::layers::{gelu, layer_norm, linear, precise_linear, relu};

/// Eps of all norms of the camera encoder.
const ENCODER_EPS: f32 = 1e-5;
/// Numbers of a code.
const CODE: usize = 9;

/// Camera tokens `[S, 2C]` to codes: the output `cam.pose_enc` `[S, 9]`.
pub(crate) fn decode(g: &mut Graph, tokens: Value) -> Result<Value, GraphError> {
    let (at, wide) = (Scope::root().pp("cam_dec"), g.shape(tokens).width());
    let mut x = tokens;
    for layer in [0, 2] {
        x = precise_linear(g, &at.pp("backbone").pp(layer), x, &[wide, wide])?;
        x = relu(g, x);
    }
    let translation = precise_linear(g, &at.pp("fc_t"), x, &[3, wide])?;
    let quaternion = precise_linear(g, &at.pp("fc_qvec"), x, &[4, wide])?;
    let fov = precise_linear(g, &at.pp("fc_fov.0"), x, &[2, wide])?;
    let fov = relu(g, fov);
    let codes = g.concat(&[translation, quaternion, fov], 1)?;
    g.output(codes, "cam.pose_enc");
    Ok(codes)
}

/// The input `camera_codes` `[S, 9]` and its tokens `cam.token` `[S, C]`; views see each other in every block.
pub(crate) fn encode(
    g: &mut Graph,
    config: &CameraEncoderConfig,
    width: usize,
    views: usize,
) -> Result<(Value, Value), GraphError> {
    let at = Scope::root().pp("cam_enc");
    let codes = g.input("camera_codes", [views, CODE]);
    let x = linear(g, &at.pp("pose_branch.fc1"), codes, width / 2)?;
    let x = gelu(g, x);
    let x = linear(g, &at.pp("pose_branch.fc2"), x, width)?;
    let mut x = layer_norm(g, &at.pp("token_norm"), x, ENCODER_EPS)?;
    for i in 0..config.blocks {
        let block = Block {
            at: at.pp("trunk").pp(i),
            heads: config.heads,
            ffn: FeedForward::Mlp { hidden: config.mlp_ratio * width },
            eps: ENCODER_EPS,
            qk_norm: false,
            rope: None,
            // A handful of rows: one product for all three is better than memory saved.
            span: Span::Groups(1),
        };
        x = block.record(g, x)?;
    }
    let x = layer_norm(g, &at.pp("trunk_norm"), x, ENCODER_EPS)?;
    Ok((codes, g.name(x, "cam.token")))
}
