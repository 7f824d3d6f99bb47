//! `omnix eval network`: a network on samples whose depth, cameras and motion are known.

use std::path::{Path, PathBuf};

use clap::Args;
use omnix::{Pixels, Query};
use omnix_data::{Pick, ReadOptions, Sample, Set, read, sets};
use omnix_eval::network::{Answer, Figures, Motion, Score, score};
use omnix_eval::run::{self, Seen};
use omnix_eval::table::Report;
use omnix_scenes::{VALIDATION_SAMPLES, validation};

use super::runner::Runner;
use crate::args::{self, DeviceArgs};
use crate::cmd::data::set_of;
use crate::error::CliError;
use crate::ui::Ui;

/// Arguments of `omnix eval network`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct NetworkArgs {
    /// Checkpoint: a folder with config.json and model.safetensors, such a file, or `nano`.
    #[arg(long, value_name = "PATH|NAME", default_value = "nano")]
    weights: String,
    /// A scene of a data set, or a folder with scenes. [default: the validation set, 40 made samples that are the same for everybody]
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// The data set, where more than one would fit.
    #[arg(long, value_name = "NAME", value_parser = set_of, requires = "data")]
    set: Option<Set>,
    /// Number of samples, at most; one of each scene on disk.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    samples: Option<u64>,
    /// Images of a sample; of a scene on disk at most, evenly spread over its first video.
    #[arg(long, value_name = "K", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=64))]
    images: u32,
    /// Size of the network's pictures, multiples of 14.
    #[arg(long, value_name = "WxH", default_value = "112x84", value_parser = args::size)]
    size: (u32, u32),
    /// Write the result to this file, and beside it as Markdown (.md).
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

/// Where samples come from.
enum Samples {
    Made(Box<omnix_scenes::Samples>),
    Disk(Vec<PathBuf>, Option<Set>),
}

/// Runs the network over all samples.
pub(crate) fn evaluate(args: &NetworkArgs, ui: &mut Ui) -> Result<Report, CliError> {
    let size = [args.size.0, args.size.1];
    let (samples, count, label) = match &args.data {
        Some(folder) => {
            let scenes = sets::find(folder, args.set)?;
            let count = scenes.len() as u64;
            (Samples::Disk(scenes, args.set), count, folder.display().to_string())
        }
        None => {
            let samples = validation(size.map(|side| side as usize), args.images as usize)?;
            (Samples::Made(Box::new(samples)), VALIDATION_SAMPLES, "validation set".to_owned())
        }
    };
    let count = count.min(args.samples.unwrap_or(u64::MAX));
    let mut runner = Runner::open(&args.weights, Some(args.size), &args.device, true)?;
    let mut figures = Figures::default();
    ui.begin("network", &format!("{count} sample(s) of {}x{}", size[0], size[1]));
    for number in 0..count {
        let (name, sample) = match &samples {
            Samples::Made(samples) => (number.to_string(), samples.get(number).map_err(CliError::from)),
            Samples::Disk(scenes, set) => {
                let path = &scenes[number as usize];
                (path.display().to_string(), of_scene(path, *set, args.images, size).map_err(CliError::from))
            }
        };
        match sample {
            Ok(sample) => figures.add(&name, judge(&mut runner, &sample)?),
            Err(error) => figures.skip(&name, error.to_string()),
        }
        ui.progress(number + 1, count);
    }
    ui.end();
    Ok(figures.report(label, &args.weights)?)
}

/// Images of a scene's first video, evenly spread.
fn of_scene(path: &Path, set: Option<Set>, images: u32, size: [u32; 2]) -> Result<Sample, omnix_data::DataError> {
    let scene = sets::open(path, set)?;
    let frames = scene.videos().first().map_or(0, |video| video.frames);
    let count = frames.min(images as usize);
    let picks: Vec<Pick> = (0..count).map(|k| Pick::plain(0, k * frames / count)).collect();
    read(scene.as_ref(), &picks, &ReadOptions { size: Some(size), dense: true, ..ReadOptions::default() })
}

/// The network's scores for a sample, and those of the trivial answers.
fn judge(runner: &mut Runner, sample: &Sample) -> Result<(Score, [Score; 3]), CliError> {
    let count = sample.count();
    let Seen { depth, cameras } = runner.look(&run::clip_of(sample))?;
    let (mut positions, mut theta) = (Vec::new(), Vec::new());
    if let Some(field) = runner.field() {
        for image in 0..count {
            let paths = field.paths(&Query::new(image, Pixels::All, 0..count))?;
            positions.extend_from_slice(paths.positions.as_chunks::<3>().0);
            theta.extend(paths.theta);
        }
    }
    let motion = runner.field().is_some().then_some(Motion { positions: &positions, theta: &theta });
    Ok(score(sample, &Answer { depth: &depth, cameras: &cameras, motion })?)
}
