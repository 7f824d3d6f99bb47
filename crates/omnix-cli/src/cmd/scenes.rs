//! `omnix scenes`: dynamic scenes made from a seed, with exact depth, cameras and meshes, for training and evaluation.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use omnix_scenes::{Assets, Job, Labels, Layout, Recipe};
use serde_json::json;

use crate::error::CliError;
use crate::ui::Ui;
use crate::{args, disk, stop};

/// Arguments of `omnix scenes`.
#[derive(Debug, Args)]
pub(crate) struct ScenesArgs {
    /// Folder to write to. Scenes that are there already are kept, so a run that was stopped goes on.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
    /// Number of scenes.
    #[arg(long, value_name = "N", default_value_t = 1)]
    scenes: u64,
    /// All scenes follow from it: the same seed and recipe give the same files.
    #[arg(long, value_name = "S", default_value_t = 0)]
    seed: u64,
    /// Cameras of a scene, all at the same times.
    #[arg(long, value_name = "N", default_value_t = 16)]
    cameras: usize,
    /// Times of a scene. [default: 16, or what the recipe says]
    #[arg(long, value_name = "N")]
    frames: Option<usize>,
    /// Size of the pictures.
    #[arg(long, value_name = "WxH", default_value = "504x280", value_parser = args::size)]
    size: (u32, u32),
    /// Recipe (TOML): what scenes are drawn from.
    #[arg(long, value_name = "FILE")]
    recipe: Option<PathBuf>,
    /// Folder of photographs to use as textures (JPEG, PNG, WebP, BMP), and of models to furnish with (OBJ, glTF, GLB, .sh3f or .zip
    /// of them). Models that cannot be used are named and left out.
    #[arg(long, value_name = "DIR")]
    assets: Option<PathBuf>,
    /// How a scene's files lie: as in the paper's own set, or in the layout that newer trainers share.
    #[arg(long, value_name = "LAYOUT", default_value = "ue")]
    layout: LayoutName,
    /// Labels to write beside those of the layout, as arrays of numpy: normals of surfaces, optical flow to the next frame.
    #[arg(long, value_name = "LABEL,..", value_delimiter = ',')]
    labels: Vec<LabelName>,
    /// Part i of n of the scenes, i from 0. [default: a Slurm array's task and number of tasks where there are such, else 0/1]
    #[arg(long, value_name = "I/N", value_parser = shard)]
    shard: Option<[u64; 2]>,
    /// One JSON object a line on standard output: scene {index, dir, kept, refused, seconds}, done {dir, scenes}, error.
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, ValueEnum)]
enum LabelName {
    Normals,
    Flow,
}

#[derive(Debug, Clone, Copy, ValueEnum)]
enum LayoutName {
    Ue,
    Omnix,
}

/// `i/n`.
fn shard(text: &str) -> Result<[u64; 2], String> {
    let parts = text.split_once('/').and_then(|(i, n)| Some([i.parse().ok()?, n.parse().ok()?]));
    match parts {
        Some([i, n]) if i < n => Ok([i, n]),
        _ => Err("expected i/n with whole numbers, i from 0 to n - 1, such as 0/4".to_owned()),
    }
}

/// The part of a Slurm array's task, if this is one.
fn array_task(variable: impl Fn(&str) -> Option<String>) -> Option<[u64; 2]> {
    let number = |name: &str| variable(name)?.parse::<u64>().ok();
    let (task, count) = (number("SLURM_ARRAY_TASK_ID")?, number("SLURM_ARRAY_TASK_COUNT")?);
    let first = number("SLURM_ARRAY_TASK_MIN").unwrap_or(0);
    let step = number("SLURM_ARRAY_TASK_STEP").unwrap_or(1).max(1);
    let part = task.checked_sub(first)? / step;
    (part < count).then_some([part, count])
}

/// Writes the scenes.
pub(crate) fn run(args: &ScenesArgs, ui: &mut Ui) -> Result<(), CliError> {
    let mut recipe = match &args.recipe {
        Some(path) => Recipe::read(path)?,
        None => Recipe::default(),
    };
    if let Some(frames) = args.frames {
        recipe.frames = frames;
    }
    let assets = args.assets.as_deref().map_or_else(|| Ok(Assets::default()), Assets::read)?;
    for note in &assets.notes {
        ui.note(note);
    }
    let job = Job {
        recipe,
        assets,
        seed: args.seed,
        scenes: args.scenes,
        cameras: args.cameras,
        size: [args.size.0 as usize, args.size.1 as usize],
        layout: match args.layout {
            LayoutName::Ue => Layout::Ue,
            LayoutName::Omnix => Layout::Omnix,
        },
        labels: Labels {
            normals: args.labels.contains(&LabelName::Normals),
            flow: args.labels.contains(&LabelName::Flow),
        },
        shard: args.shard.or_else(|| array_task(|name| std::env::var(name).ok())).unwrap_or([0, 1]),
        out: args.out.clone(),
    };
    std::fs::create_dir_all(&args.out).map_err(|source| CliError::File { path: args.out.clone(), source })?;
    disk::check(&args.out, job.bytes())?;
    stop::keep_results();
    let [shard, shards] = job.shard;
    let total = job.scenes.saturating_sub(shard).div_ceil(shards);
    let mut count = 0;
    ui.begin("scenes", &format!("{total} scene(s) to {}", args.out.display()));
    let mut since = std::time::Instant::now();
    let outcome = job.run(&stop::asked, |done| {
        count += 1;
        let refused: Vec<_> = done.refused.iter().map(|(why, n)| json!({ "reason": why.to_string(), "count": n })).collect();
        let seconds = since.elapsed().as_secs_f64();
        since = std::time::Instant::now();
        if ui.json() {
            let fields = json!({ "index": done.index, "dir": done.folder, "kept": done.kept, "refused": refused, "seconds": seconds });
            ui.event("scene", fields);
        } else {
            let redrawn: Vec<String> = done.refused.iter().map(|(why, n)| format!("{n} time(s): {why}")).collect();
            let redrawn = if redrawn.is_empty() { String::new() } else { format!("; drawn again {}", redrawn.join(", ")) };
            let how = if done.kept { "was there".to_owned() } else { format!("{seconds:.1} s") };
            ui.detail(&format!("scene {}: {how}{redrawn}", done.index));
        }
        ui.progress(count, total);
    });
    ui.end();
    outcome?;
    if ui.json() {
        ui.event("done", json!({ "dir": args.out, "scenes": count }));
    } else {
        ui.say(&format!("{count} scene(s) in {}", args.out.display()));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_are_read() {
        assert_eq!(shard("3/4"), Ok([3, 4]));
        for bad in ["4/4", "1", "-1/2", "a/b", "0/0"] {
            assert!(shard(bad).is_err(), "{bad}");
        }
        let variables = |name: &str| match name {
            "SLURM_ARRAY_TASK_ID" => Some("7".to_owned()),
            "SLURM_ARRAY_TASK_COUNT" => Some("4".to_owned()),
            "SLURM_ARRAY_TASK_MIN" => Some("1".to_owned()),
            "SLURM_ARRAY_TASK_STEP" => Some("2".to_owned()),
            _ => None,
        };
        assert_eq!(array_task(variables), Some([3, 4]));
        assert_eq!(array_task(|_| None), None);
    }
}
