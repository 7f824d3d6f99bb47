//! The encoder: tokens through blocks that attend within a view or over all views (`spec/da3.md` section 4,
//! `spec/omnix.md` section 3).
//!
//! The stream `x` is one matrix `[S·T, C]`, view after view. Blocks behind the last layer that is taken are left out.

mod embed;
mod features;
mod reference;
mod spec;
mod tokens;

use omnix_graph::{Graph, Value};

pub use spec::{BackboneOutputs, BackboneSpec, Reference, ReferenceChoice};

use crate::block::{Block, Span};
use crate::config::NetworkConfig;
use crate::{ModelError, camera, rope};
use reference::Order;

/// Eps of a block's two norms.
const BLOCK_EPS: f32 = 1e-6;

/// Records everything up to the features and the camera codes.
pub(crate) fn record(
    g: &mut Graph,
    config: &NetworkConfig,
    spec: &BackboneSpec,
) -> Result<BackboneOutputs, ModelError> {
    let (backbone, at) = (&config.backbone, config.at.pp("backbone.pretrained"));
    let given = match &config.camera_encoder {
        Some(encoder) if spec.cameras_given => Some(camera::encode(g, encoder, backbone.width, spec.images)?),
        _ => None,
    };
    let images = g.input("images", [spec.images, 3, spec.grid.0 * crate::PATCH, spec.grid.1 * crate::PATCH]);
    let mut x = embed::record(g, &at, backbone, spec, images)?;
    let rope = rope::tables(g, backbone, spec.grid);

    let mut order = Order::original(spec.images);
    let mut local = x;
    let mut taken = Vec::with_capacity(4);
    let mut exports = Vec::with_capacity(spec.export_layers.len());
    let last = spec.export_layers.iter().copied().chain([backbone.out_layers[3]]).max().unwrap_or(0);
    for i in 0..=last {
        if Some(i + 1) == backbone.alternate_from {
            // The block that follows attends within views and replaces `local`, so `x` alone is put in order.
            order = Order::choose(g, config, spec, x)?;
            x = order.apply(g, x)?;
        }
        if Some(i) == backbone.alternate_from {
            x = match given {
                Some((_, given)) => tokens::given_cameras(g, spec, x, given)?,
                None => tokens::learnt_cameras(g, &at, spec, x)?,
            };
        }
        if let Some(time) = backbone.time.filter(|t| t.from == i) {
            x = tokens::add_times(g, &at, time, spec, x)?;
        }
        let span = if backbone.is_global(i) { Span::All } else { Span::Groups(spec.images) };
        let block = Block {
            at: at.pp("blocks").pp(i),
            heads: backbone.heads,
            ffn: backbone.ffn,
            eps: BLOCK_EPS,
            qk_norm: backbone.qk_norm_from.is_some_and(|from| i >= from),
            rope: rope.filter(|_| backbone.rope_from.is_some_and(|from| i >= from)).map(|r| r.of(span)),
            span,
        };
        x = block.record(g, x)?;
        g.name(x, &format!("tok.block{i}"));
        if !backbone.is_global(i) {
            local = x;
        }
        if spec.export_layers.contains(&i) {
            exports.push((i, features::export(g, &at, spec, x, i)?));
        }
        if backbone.out_layers.contains(&i) {
            // Where views do not see each other, a block's own output is all there is.
            let beside = backbone.alternate_from.map(|_| local);
            taken.push(features::take(g, &at, spec, &order, taken.len(), (beside, x))?);
        }
    }
    let taken: [(Value, Value); 4] = taken.try_into().unwrap_or_else(|_| unreachable!("BUG: out layers were checked"));
    let pose_codes = if config.makes_cameras() { Some(camera::decode(g, taken[3].1)?) } else { None };
    Ok(BackboneOutputs {
        images,
        camera_codes: given.map(|(codes, _)| codes),
        features: taken.map(|(feature, _)| feature),
        pose_codes,
        reference: order.reference(),
        exports,
    })
}
