//! The manifest of a run, also of one that was broken off.

use omnix::checkpoint::licence;
use omnix::io::output::manifest::{Manifest, ManifestFrame, Weights as ManifestWeights, WrittenFile, path_text};
use omnix::model::config::{NetworkConfig, PointsFrom};
use serde_json::{Map, Value, json};

use super::state::Run;
use crate::args::Cameras;
use crate::{job, masking, memory};

impl Run<'_> {
    /// What the run was.
    pub(super) fn manifest(&self, files: Vec<WrittenFile>, interrupted: bool, unit: &str) -> Manifest {
        let (job, args) = (self.job, self.args);
        let (checkpoint, config) = (job.weights.checkpoint(), job.weights.network().config());
        let exports: Vec<&str> = job.exports.iter().map(|e| e.name()).collect();
        let mut versions = Map::new();
        versions.insert("omnix".to_owned(), env!("CARGO_PKG_VERSION").into());
        versions.insert("driver".to_owned(), self.info.driver.clone().into());
        let notes =
            job.input.notes.iter().cloned().chain(job.weights.note().map(str::to_owned)).chain(self.earlier_note());
        Manifest {
            network: config.name.clone(),
            weights: ManifestWeights {
                name: checkpoint.name().to_owned(),
                digest: format!("blake3:{}", checkpoint.digest()),
                licence: licence(checkpoint.name()).map(str::to_owned),
                note: job.weights.note().map(str::to_owned),
            },
            device: serde_json::to_value(&self.info).unwrap_or_default(),
            unit: unit.to_owned(),
            settings: json!({
                "inputs": self.inputs.iter().map(|input| path_text(input)).collect::<Vec<_>>(),
                "frames": args.frames,
                "fps": args.fps,
                "every": args.every,
                "start_s": args.start,
                "end_s": args.end,
                "strict": args.strict,
                "window": job.window.map(|size| size.images),
                "overlap": job.window.map(|size| size.overlap),
                "preparation": job.preparation.settings(),
                "weights_type": job::storage_name(args),
                "reference": args.reference.as_ref().map(|r| format!("{r:?}")),
                "cameras": match &args.cameras {
                    Cameras::Decoder if !config.makes_cameras() => "none".to_owned(),
                    Cameras::Decoder => "camera decoder".to_owned(),
                    Cameras::Rays => "ray maps".to_owned(),
                    Cameras::Known(path) => format!("known, from {}", path_text(path)),
                },
                "scale": args.scale.as_ref().map(ToString::to_string),
                "masks": masking::described(args, job.request.masks.as_deref()),
                "memory_budget_bytes": job.request.budget,
                "export": exports,
                "feature_blocks": job.request.features,
                "points": args.points,
                "conf_percentile": args.conf_percentile,
                "motion": self.motion,
            }),
            windows: self.windows.clone(),
            memory: json!({
                "device_planned_bytes": self.planned,
                "process_peak_bytes": memory::peak(),
            }),
            timings_s: Value::Object(self.timings.clone()),
            versions,
            frames: ManifestFrame::of_plan(&job.input, |frame| job.preparation.framing(frame), self.finished),
            notes: notes.collect(),
            files,
            network_points: network_points(config).to_owned(),
            interrupted,
        }
    }
}

/// Where trajectories start, in the words of the manifest.
pub(super) fn network_points(config: &NetworkConfig) -> &'static str {
    match config.points {
        PointsFrom::Rays => "ray maps",
        PointsFrom::Camera => "depth and camera",
    }
}
