//! The format `omnix-1` (`spec/omnix.md` section 1.1); the trajectory's part is in [`super::trajectory`].

use super::fields::Fields;
use super::{
    BackboneConfig, DepthUnit, Family, FeedForward, HeadConfig, HeadKind, NetworkConfig, PointsFrom, TimeConfig,
    trajectory,
};
use crate::{ModelError, PATCH};
use omnix_weights::Scope;

const FIELDS: [&str; 8] =
    ["format", "variant", "key_prefix", "name", "backbone", "depth_head", "points_from", "trajectory"];
const BACKBONE_FIELDS: [&str; 15] = [
    "embed_dim",
    "depth",
    "heads",
    "mlp_ratio",
    "ffn",
    "patch",
    "position_grid",
    "out_layers",
    "alternate_from",
    "qk_norm_from",
    "rope_from",
    "rope_base",
    "concat_local",
    "reference_view",
    "time",
];
const HEAD_FIELDS: [&str; 4] = ["features", "channels", "aux_convs", "logit_clamp"];

/// Reads a configuration of this format.
pub(super) fn read(root: &Fields<'_>) -> Result<NetworkConfig, ModelError> {
    root.one_of("format", &["omnix-1"])?;
    root.one_of("variant", &["release"])?;
    root.only(&FIELDS)?;
    let name = if root.get("name").is_some() { root.text("name")? } else { "omnix" };
    let key_prefix = if root.get("key_prefix").is_some() { Some(root.text("key_prefix")?.to_owned()) } else { None };
    let points = match root.one_of("points_from", &["rays", "camera"])? {
        0 => PointsFrom::Rays,
        _ => PointsFrom::Camera,
    };
    let trajectory = match root.get("trajectory") {
        Some(_) => Some(trajectory::read::read(&root.object("trajectory")?)?),
        None => None,
    };
    Ok(NetworkConfig {
        name: name.to_owned(),
        family: Family::OmniX,
        key_prefix,
        at: Scope::root(),
        backbone: backbone(&root.object("backbone")?)?,
        head: head(&root.object("depth_head")?)?,
        camera_encoder: None,
        points,
        trajectory,
        unit: DepthUnit::Own,
        metric: None,
        gaussians: None,
    })
}

fn backbone(part: &Fields<'_>) -> Result<BackboneConfig, ModelError> {
    part.only(&BACKBONE_FIELDS)?;
    if part.whole("patch")? != PATCH {
        return Err(part.bad("patch", format!("it can be {PATCH}")));
    }
    if part.get("concat_local").and_then(serde_json::Value::as_bool) != Some(true) {
        return Err(part.bad("concat_local", "it can be true"));
    }
    part.one_of("reference_view", &["first"])?;
    let (width, ratio) = (part.whole("embed_dim")?, part.whole("mlp_ratio")?);
    let Some(hidden) = width.checked_mul(ratio).filter(|hidden| (1..=super::need::WIDEST).contains(hidden)) else {
        return Err(part.bad("mlp_ratio", format!("times embed_dim it can be 1 to {}", super::need::WIDEST)));
    };
    let ffn = match part.one_of("ffn", &["mlp", "swiglu"])? {
        0 => FeedForward::Mlp { hidden },
        _ => FeedForward::swiglu(width, ratio),
    };
    let alternate_from = part.start("alternate_from")?;
    if alternate_from.is_none() {
        return Err(part.bad("alternate_from", "a block's number is needed"));
    }
    let time = match part.get("time") {
        Some(_) => {
            let time = part.object("time")?;
            time.only(&["from", "base"])?;
            Some(TimeConfig { from: time.whole("from")?, base: time.number("base")? })
        }
        None => None,
    };
    Ok(BackboneConfig {
        width,
        blocks: part.whole("depth")?,
        heads: part.whole("heads")?,
        ffn,
        position_grid: part.whole("position_grid")?,
        out_layers: part.four("out_layers")?,
        alternate_from,
        qk_norm_from: part.start("qk_norm_from")?,
        rope_from: part.start("rope_from")?,
        rope_base: part.number("rope_base")?,
        time,
    })
}

fn head(part: &Fields<'_>) -> Result<HeadConfig, ModelError> {
    part.only(&HEAD_FIELDS)?;
    let logit_clamp = match part.get("logit_clamp") {
        Some(_) => Some(part.number("logit_clamp")? as f32),
        None => None,
    };
    Ok(HeadConfig {
        kind: HeadKind::Dual { aux_convs: part.whole("aux_convs")? },
        features: part.whole("features")?,
        channels: part.four("channels")?,
        logit_clamp,
    })
}
