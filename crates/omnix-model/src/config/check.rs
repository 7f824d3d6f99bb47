//! Whether the numbers of a configuration go together, before anything is recorded.

use super::need::{WIDEST, heads_fit};
use super::{BackboneConfig, CameraEncoderConfig, Family, GaussianConfig, HeadConfig, HeadKind, NetworkConfig};
use crate::ModelError;
use omnix_graph::ops::WIDEST_HEAD;

/// No published number of blocks comes near; larger ones are slips of the pen.
const DEEPEST: usize = 1 << 10;

/// Field names of our own format and of the published one.
const LABELS: [(&str, &str); 10] = [
    ("backbone.embed_dim", "net.embed_dim"),
    ("backbone.depth", "net.depth"),
    ("backbone.heads", "net.num_heads"),
    ("backbone.out_layers", "net.out_layers"),
    ("backbone.alternate_from", "net.alt_start"),
    ("depth_head.features", "head.features"),
    ("depth_head.channels", "head.out_channels"),
    ("backbone.position_grid", "position_grid"),
    ("backbone.rope_base", "rope_base"),
    ("depth_head.aux_convs", "aux_convs"),
];

impl NetworkConfig {
    /// Checks that the numbers go together; [`NetworkConfig::from_json`] has done so.
    ///
    /// # Errors
    /// [`ModelError::BadField`] for the first that does not fit.
    pub fn check(&self) -> Result<(), ModelError> {
        let need = |fits: bool, label: &'static str, value: &dyn std::fmt::Debug, allowed: String| {
            let label = match self.family {
                Family::OmniX => label,
                Family::DepthAnything3 => {
                    LABELS.iter().find(|(own, _)| *own == label).map_or(label, |(_, theirs)| *theirs)
                }
            };
            let bad = || ModelError::BadField { field: label.to_owned(), value: format!("{value:?}"), allowed };
            if fits { Ok(()) } else { Err(bad()) }
        };
        let BackboneConfig { width, blocks, heads, position_grid, out_layers, alternate_from, rope_base, .. } =
            self.backbone;
        need((1..=WIDEST).contains(&width), "backbone.embed_dim", &width, format!("it can be 1 to {WIDEST}"))?;
        need((1..=DEEPEST).contains(&blocks), "backbone.depth", &blocks, format!("it can be 1 to {DEEPEST}"))?;
        // Queries and keys turn in rows and in columns.
        let turned = self.backbone.rope_from.is_some();
        heads_fit(&need, "backbone.heads", width, heads, turned)?;
        let rising = out_layers.is_sorted_by(|a, b| a < b) && out_layers[3] < blocks;
        need(rising, "backbone.out_layers", &out_layers, format!("rising numbers of the {blocks} blocks are needed"))?;
        // Before it there is a block whose class tokens choose the reference, and one after the choice.
        let least = if self.family == Family::DepthAnything3 { 2 } else { 1 };
        if let Some(from) = alternate_from {
            need((least..blocks).contains(&from), "backbone.alternate_from", &from, {
                format!("it can be {least} to {}", blocks - 1)
            })?;
        }
        let kinds = self.makes_cameras() == alternate_from.is_some();
        need(kinds, "backbone.alternate_from", &alternate_from, {
            "a block's number goes with a head that makes confidence and rays, none with one that makes sky".to_owned()
        })?;
        need(
            (1..=512).contains(&position_grid),
            "backbone.position_grid",
            &position_grid,
            "it can be 1 to 512".to_owned(),
        )?;
        let base_allowed = || "a number above 1 is needed".to_owned();
        need(rope_base > 1.0 && rope_base.is_finite(), "backbone.rope_base", &rope_base, base_allowed())?;
        if let Some(time) = self.backbone.time {
            need(time.from < blocks, "backbone.time.from", &time.from, format!("it can be 0 to {}", blocks - 1))?;
            need(time.base > 1.0 && time.base.is_finite(), "backbone.time.base", &time.base, base_allowed())?;
            need(width.is_multiple_of(2), "backbone.embed_dim", &width, "time codes need an even number".to_owned())?;
        }
        let HeadConfig { kind, features, channels, logit_clamp } = self.head;
        // Half of the features get a UV code, which has four parts.
        let features_fit = |f: usize| (8..=WIDEST).contains(&f) && f.is_multiple_of(8);
        need(features_fit(features), "depth_head.features", &features, "a multiple of 8 is needed".to_owned())?;
        let fit = |c: &usize| (4..=WIDEST).contains(c) && c.is_multiple_of(4);
        need(channels.iter().all(fit), "depth_head.channels", &channels, "multiples of 4 are needed".to_owned())?;
        if let Some(GaussianConfig { features, channels }) = self.gaussians {
            need(features_fit(features), "gs_head.features", &features, "a multiple of 8 is needed".to_owned())?;
            need(channels.iter().all(fit), "gs_head.out_channels", &channels, "multiples of 4 are needed".to_owned())?;
        }
        if let HeadKind::Dual { aux_convs } = kind {
            let fits = aux_convs % 2 == 1 && aux_convs <= 15;
            need(fits, "depth_head.aux_convs", &aux_convs, "it can be 1, 3, .. 15".to_owned())?;
        }
        if let Some(clamp) = logit_clamp {
            let fits = clamp > 0.0 && clamp.is_finite();
            need(fits, "depth_head.logit_clamp", &clamp, "a number above 0, or null for none, is needed".to_owned())?;
        }
        if let Some(CameraEncoderConfig { heads, .. }) = self.camera_encoder {
            let fits = width.is_multiple_of(heads) && width / heads <= WIDEST_HEAD;
            need(fits, "backbone.embed_dim", &width, {
                format!("the camera encoder needs a multiple of {heads}, up to {}", heads * WIDEST_HEAD)
            })?;
        }
        if let Some(trajectory) = &self.trajectory {
            super::trajectory::check::check(trajectory, self.backbone.feature_width(), &need)?;
        }
        self.metric.as_ref().map_or(Ok(()), |metric| metric.check())
    }
}
