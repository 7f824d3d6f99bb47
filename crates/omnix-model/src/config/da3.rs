//! The `config.json` published with Depth Anything 3 (`spec/da3.md` sections 1 and 12).
//!
//! `{"model_name": "da3-small", "config": {net, head, cam_enc, cam_dec, ..}}`: a known name decides, as upstream; else the
//! tree is read. Files with only one of the two are accepted. Monocular and metric networks have the same tree and tensors: one
//! whose name says `metric` is metric.

use super::fields::Fields;
use super::{
    BackboneConfig, CameraEncoderConfig, DepthUnit, Family, FeedForward, GaussianConfig, HeadConfig, HeadKind,
    NetworkConfig, PointsFrom,
};
use crate::ModelError;
use omnix_geometry::GAUSSIAN_NUMBERS;
use omnix_weights::{METRIC, Scope};

/// Sides of the position table in all published files.
const POSITION_GRID: usize = 37;
/// Base of RoPE, fixed upstream.
const ROPE_BASE: f64 = 100.0;
/// Convolutions of the ray branch, fixed upstream.
const AUX_CONVS: usize = 5;
/// Hidden width of a block over its width.
const MLP_RATIO: usize = 4;

/// An encoder of the table.
struct Encoder {
    name: &'static str,
    width: usize,
    blocks: usize,
    heads: usize,
    ffn: FeedForward,
}

const ENCODERS: [Encoder; 4] = [
    Encoder { name: "vits", width: 384, blocks: 12, heads: 6, ffn: FeedForward::Mlp { hidden: 1536 } },
    Encoder { name: "vitb", width: 768, blocks: 12, heads: 12, ffn: FeedForward::Mlp { hidden: 3072 } },
    Encoder { name: "vitl", width: 1024, blocks: 24, heads: 16, ffn: FeedForward::Mlp { hidden: 4096 } },
    Encoder { name: "vitg", width: 1536, blocks: 40, heads: 24, ffn: FeedForward::swiglu(1536, MLP_RATIO) },
];

/// A row of the table of published networks.
pub(super) struct Published {
    encoder: usize,
    out_layers: [usize; 4],
    alternate_from: Option<usize>,
    features: usize,
    channels: [usize; 4],
    gaussians: bool,
}

pub(super) const SMALL: Published = Published {
    encoder: 0,
    out_layers: [5, 7, 9, 11],
    alternate_from: Some(4),
    features: 64,
    channels: [48, 96, 192, 384],
    gaussians: false,
};
pub(super) const BASE: Published = Published { encoder: 1, features: 128, channels: [96, 192, 384, 768], ..SMALL };
pub(super) const LARGE: Published = Published {
    encoder: 2,
    out_layers: [11, 15, 19, 23],
    alternate_from: Some(8),
    features: 256,
    channels: [256, 512, 1024, 1024],
    gaussians: false,
};
pub(super) const GIANT: Published =
    Published { encoder: 3, out_layers: [19, 27, 33, 39], alternate_from: Some(13), gaussians: true, ..LARGE };
/// Monocular and metric.
pub(super) const SINGLE: Published = Published { out_layers: [4, 11, 17, 23], alternate_from: None, ..LARGE };

const BY_NAME: [(&str, &Published); 6] = [
    ("da3-small", &SMALL),
    ("da3-base", &BASE),
    ("da3-large", &LARGE),
    ("da3-giant", &GIANT),
    ("da3mono-large", &SINGLE),
    ("da3metric-large", &SINGLE),
];
const NESTED: &str = "da3nested-giant-large";

/// A row of the table as a configuration.
pub(super) fn published(name: &str, row: &Published) -> NetworkConfig {
    let Encoder { width, blocks, heads, ffn, .. } = ENCODERS[row.encoder];
    let start = row.alternate_from;
    let backbone = BackboneConfig {
        width,
        blocks,
        heads,
        ffn,
        position_grid: POSITION_GRID,
        out_layers: row.out_layers,
        alternate_from: start,
        qk_norm_from: start,
        rope_from: start,
        rope_base: ROPE_BASE,
        time: None,
    };
    let gaussians = row.gaussians.then_some(GaussianConfig { features: row.features, channels: row.channels });
    let encoder = start.map(|_| CameraEncoderConfig::default());
    assemble(name, backbone, row.features, row.channels, encoder, gaussians)
}

/// da3nested-giant-large.
pub(super) fn published_nested() -> NetworkConfig {
    nested(NESTED, published("da3-giant", &GIANT), published("da3metric-large", &SINGLE))
}

/// An any-view network and the metric one beside it.
fn nested(name: &str, any_view: NetworkConfig, metric: NetworkConfig) -> NetworkConfig {
    let metric = NetworkConfig { at: Scope::root().pp(METRIC), unit: DepthUnit::Canonical, ..metric };
    NetworkConfig { name: name.to_owned(), unit: DepthUnit::Metres, metric: Some(Box::new(metric)), ..any_view }
}

fn assemble(
    name: &str,
    backbone: BackboneConfig,
    features: usize,
    channels: [usize; 4],
    camera_encoder: Option<CameraEncoderConfig>,
    gaussians: Option<GaussianConfig>,
) -> NetworkConfig {
    let single = backbone.alternate_from.is_none();
    let kind = if single { HeadKind::Sky } else { HeadKind::Dual { aux_convs: AUX_CONVS } };
    let canonical = single && name.to_ascii_lowercase().contains("metric");
    NetworkConfig {
        name: name.to_owned(),
        family: Family::DepthAnything3,
        key_prefix: None,
        at: Scope::root(),
        backbone,
        head: HeadConfig { kind, features, channels, logit_clamp: None },
        camera_encoder,
        points: PointsFrom::Camera,
        trajectory: None,
        unit: if canonical { DepthUnit::Canonical } else { DepthUnit::Own },
        metric: None,
        gaussians,
    }
}

/// Reads a published `config.json`.
pub(super) fn read(root: &Fields<'_>) -> Result<NetworkConfig, ModelError> {
    let name = if root.get("model_name").is_some() { Some(root.text("model_name")?) } else { None };
    if let Some(name) = name {
        let known = name.to_ascii_lowercase();
        // Retrained networks of the same architecture.
        let known = known.trim_end_matches("-1.1");
        if let Some((name, row)) = BY_NAME.iter().find(|(n, _)| *n == known) {
            return Ok(published(name, row));
        }
        if known == NESTED {
            return Ok(published_nested());
        }
    }
    let tree = match (root.get("config"), root.get("net").or(root.get("anyview"))) {
        (Some(_), _) => root.object("config")?,
        (None, Some(_)) => root.clone(),
        (None, None) => {
            let allowed =
                "neither the `model_name` of a published network, nor a tree `config`, nor `format` \"omnix-1\"";
            return Err(ModelError::FieldMissing { field: "config".to_owned(), allowed: allowed.to_owned() });
        }
    };
    read_tree(name.unwrap_or("da3-custom"), &tree)
}

/// The class that a part of the tree is an instance of.
fn class<'a>(part: &Fields<'a>) -> Option<&'a str> {
    part.get("__object__")?.get("name")?.as_str()
}

fn read_tree(name: &str, tree: &Fields<'_>) -> Result<NetworkConfig, ModelError> {
    if class(tree) == Some("NestedDepthAnything3Net") || tree.get("anyview").is_some() {
        let part = |which: &str| read_single(&format!("{name} ({which})"), &tree.object(which)?);
        let (any_view, metric) = (part("anyview")?, part("metric")?);
        let kinds = [(&any_view, true, "anyview"), (&metric, false, "metric")];
        if let Some((.., which)) = kinds.into_iter().find(|(part, cameras, _)| part.makes_cameras() != *cameras) {
            return Err(tree.bad(which, "a nested network is an any-view network and a metric one"));
        }
        return Ok(nested(name, any_view, metric));
    }
    read_single(name, tree)
}

/// A tree of one network.
fn read_single(name: &str, tree: &Fields<'_>) -> Result<NetworkConfig, ModelError> {
    let net = tree.object("net")?;
    let head = tree.object("head")?;
    let alternate_from = net.start("alt_start")?;
    let single = alternate_from.is_none();
    let concatenates = net.get("cat_token").is_none_or(|v| v.as_bool() == Some(true));
    if concatenates == single {
        let allowed = "it must be true where blocks alternate (net.alt_start), and false where they do not";
        return Err(net.bad("cat_token", allowed));
    }
    if class(&head).is_some_and(|class| class != if single { "DPT" } else { "DualDPT" }) {
        return Err(head.bad("__object__", "blocks that alternate (net.alt_start) go with DualDPT, others with DPT"));
    }
    let (width, blocks, heads, ffn) = encoder(&net)?;
    let backbone = BackboneConfig {
        width,
        blocks,
        heads,
        ffn,
        position_grid: POSITION_GRID,
        out_layers: net.four("out_layers")?,
        alternate_from,
        qk_norm_from: net.start("qknorm_start")?,
        rope_from: net.start("rope_start")?,
        rope_base: ROPE_BASE,
        time: None,
    };
    if single {
        fixed(&head, "dim_in", width, "the encoder's width")?;
        fixed(&head, "output_dim", 1, "depth")?;
    } else {
        let wide = 2 * width;
        fixed(&head, "dim_in", wide, "twice the encoder's width")?;
        fixed(&head, "output_dim", 2, "depth and confidence")?;
        fixed(&tree.object("cam_dec")?, "dim_in", wide, "twice the encoder's width")?;
    }
    let camera_encoder = match tree.get("cam_enc") {
        Some(_) if !single => {
            fixed(&tree.object("cam_enc")?, "dim_out", width, "the encoder's width")?;
            Some(CameraEncoderConfig::default())
        }
        _ => None,
    };
    let gaussians = match tree.get("gs_head") {
        Some(_) if !single => {
            let part = tree.object("gs_head")?;
            fixed(&part, "dim_in", 2 * width, "twice the encoder's width")?;
            fixed(&part, "output_dim", GAUSSIAN_NUMBERS, "the numbers of a Gaussian")?;
            Some(GaussianConfig { features: part.whole("features")?, channels: part.four("out_channels")? })
        }
        _ => None,
    };
    let (features, channels) = (head.whole("features")?, head.four("out_channels")?);
    Ok(assemble(name, backbone, features, channels, camera_encoder, gaussians))
}

/// Width, blocks, heads and feed-forward layer by `net.name`.
fn encoder(net: &Fields<'_>) -> Result<(usize, usize, usize, FeedForward), ModelError> {
    let name = net.text("name")?;
    if let Some(e) = ENCODERS.iter().find(|e| e.name == name) {
        return Ok((e.width, e.blocks, e.heads, e.ffn));
    }
    if name != "custom" {
        return Err(net.bad("name", "it can be vits, vitb, vitl, vitg or custom"));
    }
    let width = net.whole("embed_dim")?;
    if width > super::need::WIDEST {
        return Err(net.bad("embed_dim", format!("it can be 1 to {}", super::need::WIDEST)));
    }
    let ffn = match net.one_of("ffn_layer", &["mlp", "swiglufused"])? {
        0 => FeedForward::Mlp { hidden: MLP_RATIO * width },
        _ => FeedForward::swiglu(width, MLP_RATIO),
    };
    Ok((width, net.whole("depth")?, net.whole("num_heads")?, ffn))
}

/// A number that another one already fixes.
fn fixed(part: &Fields<'_>, name: &str, wanted: usize, why: &str) -> Result<(), ModelError> {
    match part.whole(name)? {
        found if found == wanted => Ok(()),
        _ => Err(part.bad(name, format!("it must be {wanted}, {why}"))),
    }
}
