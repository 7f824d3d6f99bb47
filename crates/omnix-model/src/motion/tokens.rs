//! Tokens, their score, the choice, and the expansion over target times (`spec/omnix.md` section 5; AdaLN: section 9).

use omnix_geometry::codes::time_codes;
use omnix_graph::ops::Expand;
use omnix_graph::ops::Unary;
use omnix_graph::{Graph, GraphError, Value};
use omnix_weights::Scope;

use super::spec::{FORCED, LeaveOut, MotionSpec, root};
use crate::config::{TimeGain, TokenFeatures, TrajectoryConfig};
use crate::layers::{linear, linear_columns, linear_rows, pointwise_conv, relu};

/// Eps of the norm without weights of the AdaLN ablations.
const MODULATED_EPS: f32 = 1e-6;

/// Tokens and the inputs they are made of.
pub(super) struct Tokens {
    pub(super) features: Vec<Value>,
    pub(super) point_tokens: Option<Value>,
    /// F `[T, L, d]`: queries come from it, and every block attends to it unchanged.
    pub(super) tokens: Value,
}

/// The tokens that are followed.
pub(super) struct Chosen {
    /// u32 `[T, K]`: cells within the image, ascending.
    pub(super) places: Value,
    /// u32 `[T · K]`: the same as rows of F.
    pub(super) rows: Value,
    /// `[T, L]`: 1 where chosen.
    pub(super) mask: Value,
}

/// `F = feature_proj(features side by side) + pts3d_proj(points)`; the features are never put side by side: they are the
/// largest values of the program.
pub(super) fn record(
    g: &mut Graph,
    config: &TrajectoryConfig,
    wide: usize,
    spec: &MotionSpec,
) -> Result<Tokens, GraphError> {
    let (shape, d, at) = ([spec.images, spec.patches()], config.width, root().pp("feature_proj"));
    let taken = match config.token_features {
        TokenFeatures::All => 0..4,
        TokenFeatures::Last => 3..4,
    };
    let features: Vec<Value> = taken.map(|k| g.input(&format!("feat.{k}"), [shape[0], shape[1], wide])).collect();
    let full = [d, features.len() * wide];
    let mut tokens = linear_columns(g, &at, features[0], full, 0..wide, true)?;
    for (k, feature) in features.iter().enumerate().skip(1) {
        let part = linear_columns(g, &at, *feature, full, k * wide..(k + 1) * wide, false)?;
        tokens = g.add_values(part, tokens)?;
    }
    g.name(tokens, "traj.feature_tokens");
    let point_tokens = config.token_points.then(|| g.input("traj.point_tokens", [shape[0], shape[1], d]));
    if let Some(points) = point_tokens {
        tokens = g.add_values(tokens, points)?;
        g.name(tokens, "traj.tokens");
    }
    Ok(Tokens { features, point_tokens, tokens })
}

/// The probability of motion `[T, L]`.
pub(super) fn score(
    g: &mut Graph,
    config: &TrajectoryConfig,
    spec: &MotionSpec,
    tokens: Value,
    leave_out: Option<LeaveOut>,
) -> Result<Value, GraphError> {
    let [first, second] = config.scalar_widths();
    let x = pointwise_conv(g, &root().pp("dynamic_pred.0"), tokens, first)?;
    let x = thinned(g, x, leave_out, 0)?;
    let x = pointwise_conv(g, &root().pp("dynamic_pred.3"), x, second)?;
    let x = thinned(g, x, leave_out, 1)?;
    let x = pointwise_conv(g, &root().pp("dynamic_pred_last_layer"), x, 1)?;
    let logits = g.reshape(x, [spec.images, spec.patches()])?;
    g.name(logits, "traj.score_logit");
    let score = g.map(Unary::Sigmoid, logits);
    if !spec.forced {
        return Ok(score);
    }
    let [r#where, to] = FORCED.map(|name| g.input(name, [spec.images, spec.patches()]));
    g.select(r#where, to, score)
}

/// The tokens of highest score, the same number in every image.
pub(super) fn choose(
    g: &mut Graph,
    config: &TrajectoryConfig,
    spec: &MotionSpec,
    score: Value,
) -> Result<Chosen, GraphError> {
    let k = config.chosen(spec.patches());
    let (places, mask) = g.top_k(score, k)?;
    g.name(places, "traj.index");
    let (rows, _) = g.top_k_flat(score, k)?;
    let rows = g.reshape(rows, [spec.images * k])?;
    Ok(Chosen { places, rows, mask })
}

/// Codes of the target times `[T, d]`.
pub(super) fn codes(g: &mut Graph, config: &TrajectoryConfig, spec: &MotionSpec) -> Result<Value, GraphError> {
    let (times, d) = (spec.images, config.width);
    let mut projected = |name: &str, layer: &str, places: Vec<f64>| {
        let code = g.constant(&format!("{name}.code"), [times, d], time_codes(&places, d, config.time_base));
        let value = linear(g, &root().pp(layer), code, d)?;
        Ok::<_, GraphError>(g.name(value, name))
    };
    let videos = spec.times.iter().map(|t| f64::from(t.0)).collect();
    let videos = projected("traj.time.video", "video_idx_embed.proj", videos)?;
    let frames = spec.times.iter().map(|t| f64::from(t.1)).collect();
    let frames = projected("traj.time.frame", "local_time_idx_embed.proj", frames)?;
    g.add_values(frames, videos)
}

/// `traj.z0` `[T · T · K, d]`: every chosen token once for every target time, marked with its code.
pub(super) fn expand(
    g: &mut Graph,
    config: &TrajectoryConfig,
    spec: &MotionSpec,
    (tokens, chosen): (Value, &Chosen),
    codes: Value,
    leave_out: Option<LeaveOut>,
) -> Result<Value, GraphError> {
    let d = config.width;
    let rows = g.reshape(tokens, [spec.images * spec.patches(), d])?;
    let q = g.gather(rows, chosen.rows)?;
    let z = match config.time_gain {
        TimeGain::None => g.token_expand(q, codes, Expand::default())?,
        TimeGain::PerToken => {
            let gain = gain(g, config, q, leave_out)?;
            g.token_expand(q, codes, Expand { kappa: Some(gain), ..Expand::default() })?
        }
        TimeGain::AdaLn | TimeGain::TokenAdaLn => modulated(g, config, q, codes)?,
    };
    let z = g.reshape(z, [spec.images * g.shape(q)[0], d])?;
    Ok(g.name(z, "traj.z0"))
}

/// `relu(x)`, some of it left out where that is asked for.
fn thinned(g: &mut Graph, x: Value, leave_out: Option<LeaveOut>, stream: u32) -> Result<Value, GraphError> {
    let x = relu(g, x);
    leave_out.map_or(Ok(x), |leave_out| leave_out.of(g, x, stream))
}

/// One number per token, at least 0.
fn gain(g: &mut Graph, config: &TrajectoryConfig, q: Value, leave_out: Option<LeaveOut>) -> Result<Value, GraphError> {
    let ([first, second], at) = (config.scalar_widths(), root().pp("time_embed_scaling_mlp"));
    let x = linear(g, &at.pp(0), q, first)?;
    let x = thinned(g, x, leave_out, 2)?;
    let x = linear(g, &at.pp(3), x, second)?;
    let x = thinned(g, x, leave_out, 3)?;
    let x = linear(g, &at.pp(6), x, 1)?;
    let gain = g.map(Unary::Softplus, x);
    Ok(g.name(gain, "traj.time_gain"))
}

/// `LN(q) · (1 + α a_t) + κ c_t`, α and κ the token's own where the configuration says so.
fn modulated(g: &mut Graph, config: &TrajectoryConfig, q: Value, codes: Value) -> Result<Value, GraphError> {
    let d = config.width;
    let pair = |g: &mut Graph, at: &Scope, x: Value, n: usize| {
        let x = g.map(Unary::Silu, x);
        let half = |g: &mut Graph, i: usize| linear_rows(g, at, x, 2 * n, i * n..(i + 1) * n, &[2 * n, d]);
        Ok::<_, GraphError>((half(g, 0)?, half(g, 1)?))
    };
    let (scale, shift) = pair(g, &root().pp("sp_adaln.t_proj.1"), codes, d)?;
    let mut parts = Expand { scale: Some(scale), ..Expand::default() };
    if config.time_gain == TimeGain::TokenAdaLn {
        let (alpha, kappa) = pair(g, &root().pp("sp_adaln.dy_proj.1"), q, 1)?;
        (parts.alpha, parts.kappa) = (Some(alpha), Some(kappa));
    }
    let normed = g.layer_norm(q, None, None, MODULATED_EPS)?;
    g.token_expand(normed, shift, parts)
}
