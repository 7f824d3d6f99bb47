//! `omnix eval network`: a network on samples whose depth, cameras and motion are known.

use std::path::{Path, PathBuf};

use clap::Args;
use omnix::io::Picture;
use omnix::io::preprocess::normalise;
use omnix::{Engine, Event, Pixels, Query, Request, RunPlan, Session, Weights};
use omnix_data::{Pick, ReadOptions, Sample, Set, read, sets};
use omnix_eval::network::{Answer, Figures, Motion, Score, score};
use omnix_eval::table::Report;
use omnix_scenes::{VALIDATION_SAMPLES, validation};

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
    let mut network = Network { engine: args.device.open()?, weights: Weights::find(&args.weights)?, ready: None };
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
            Ok(sample) => figures.add(&name, network.judge(&sample)?),
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

/// What a session was planned for: the images' times, (video, frame), and their size.
type Shape = (Vec<(u32, u32)>, [u32; 2]);

/// A network, and its session for samples of one shape.
struct Network {
    engine: Engine,
    weights: Weights,
    ready: Option<(Shape, Session)>,
}

impl Network {
    /// The network's scores for a sample, and those of the trivial answers.
    fn judge(&mut self, sample: &Sample) -> Result<(Score, [Score; 3]), CliError> {
        let (count, pixels) = (sample.count(), sample.pixels());
        let session = self.session(sample)?;
        let mut plane = vec![0.0; 3 * pixels];
        for image in 0..count {
            let [width, height] = sample.size();
            normalise(&Picture::new(width, height, sample.image(image).to_vec()), &mut plane);
            session.set_image(image, &plane)?;
        }
        let (mut depth, mut cameras, mut field) = (vec![0.0; count * pixels], Vec::new(), None);
        session.run(&mut |event| {
            match event {
                Event::Frame(frame) => {
                    depth[frame.index * pixels..(frame.index + 1) * pixels].copy_from_slice(&frame.depth);
                    cameras.push(frame.camera);
                }
                Event::Field(made) => field = Some(made),
                _ => {}
            }
            Ok(())
        })?;
        let (mut positions, mut theta) = (Vec::new(), Vec::new());
        if let Some(field) = &field {
            for image in 0..count {
                let paths = field.paths(&Query::new(image, Pixels::All, 0..count))?;
                positions.extend(paths.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
                theta.extend(paths.theta);
            }
        }
        let motion = field.is_some().then_some(Motion { positions: &positions, theta: &theta });
        Ok(score(sample, &Answer { depth: &depth, cameras: &cameras, motion })?)
    }

    /// The session for samples of this shape and these times.
    fn session(&mut self, sample: &Sample) -> Result<&mut Session, CliError> {
        let times: Vec<(u32, u32)> = sample.times().iter().map(|time| (time.video, time.frame)).collect();
        let key = (times.clone(), sample.size());
        let ready = match self.ready.take() {
            Some(ready) if ready.0 == key => ready,
            _ => {
                let [width, height] = sample.size().map(|side| side as usize);
                let motion = self.weights.network().config().trajectory.is_some();
                let request = Request::new(sample.count(), height, width).times(times).motion(motion);
                let plan = RunPlan::new(&self.weights, &request, self.engine.caps())?;
                (key, Session::new(&self.engine, &self.weights, plan, &mut omnix::quiet())?)
            }
        };
        Ok(&mut self.ready.insert(ready).1)
    }
}
