//! `omnix eval efficiency`: what a network costs, counted and measured, as papers print it.
//!
//! Two counts of multiply-adds stand beside each other, because papers differ: of linear layers and convolutions alone, which is what
//! profilers see that look at layers, and of everything, the products of attention included. Pictures are noise; no figure depends on
//! what they show.

use std::time::Instant;

use clap::Args;
use omnix::{Engine, RunPlan, Session, Weights};
use omnix_eval::table::{Column, Protocol, Report, Row};

use crate::args::{self, DeviceArgs};
use crate::error::CliError;
use crate::memory;
use crate::ui::Ui;

/// Arguments of `omnix eval efficiency`.
#[derive(Debug, Args)]
#[command(after_long_help = crate::error::EXIT_CODES)]
pub(crate) struct EfficiencyArgs {
    /// Checkpoint: a folder with config.json and model.safetensors, such a file, or `nano`.
    #[arg(long, value_name = "PATH|NAME", default_value = "nano")]
    weights: String,
    /// Numbers of images, a row each; peak memory is that of the process so far, so the smallest first.
    #[arg(long, value_name = "N,..", value_delimiter = ',', default_value = "16", value_parser = clap::value_parser!(u32).range(1..=1024))]
    images: Vec<u32>,
    /// Size of the network's pictures, multiples of 14.
    #[arg(long, value_name = "WxH", default_value = "504x280", value_parser = args::size)]
    size: (u32, u32),
    /// Runs, of which the time is the median; one more, which compiles what is missing, comes before them.
    #[arg(long, value_name = "N", default_value_t = 3, value_parser = clap::value_parser!(u32).range(1..=1000))]
    runs: u32,
    /// Write the result to this file, and beside it as Markdown (.md).
    #[arg(long, value_name = "FILE")]
    pub(crate) json: Option<std::path::PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
}

const COLUMNS: [Column; 8] = [
    Column::less("parameters", "M"),
    Column::less("layers", "T multiply-adds"),
    Column::less("all", "T multiply-adds"),
    Column::less("planned", "MiB"),
    Column::less("measured", "MiB"),
    Column::less("start", "s"),
    Column::less("run", "s"),
    Column::less("image", "s"),
];
const MEBI: f64 = (1 << 20) as f64;

/// Plans and runs the network for each number of images.
pub(crate) fn evaluate(args: &EfficiencyArgs, ui: &mut Ui) -> Result<Report, CliError> {
    let (engine, weights) = (args.device.open()?, Weights::find(&args.weights)?);
    let mut counts: Vec<usize> = args.images.iter().map(|count| *count as usize).collect();
    counts.sort_unstable();
    counts.dedup();
    let mut rows = Vec::with_capacity(counts.len());
    ui.begin("efficiency", &format!("{} number(s) of images, {} run(s) each", counts.len(), args.runs));
    for (done, count) in (1..).zip(&counts) {
        rows.push(row(args, &engine, &weights, *count)?);
        ui.progress(done, counts.len() as u64);
    }
    ui.end();
    let info = engine.info();
    let (width, height) = args.size;
    Ok(Report {
        kind: "efficiency",
        protocol: Protocol {
            data_set: format!("{} on {} ({})", args.weights, info.name, info.backend),
            split: format!("pictures of {width}x{height}, noise"),
            mean: format!("median of {} run(s) after one that compiles", args.runs),
            ..Protocol::default()
        },
        columns: COLUMNS.to_vec(),
        rows,
        sequences: Vec::new(),
        skipped: Vec::new(),
        notes: vec![
            "layers: linear layers and convolutions; all: the products of attention and everything else too".to_owned(),
            "planned: bytes on the device, weights included; measured: peak resident memory of the process, where the system says it; on a \
             device with memory of its own that is the host's part"
                .to_owned(),
            "start: planning, weights and pipelines; run: pictures to depth, cameras and, of a network with trajectories, their field; \
             image: run over the number of images"
                .to_owned(),
        ],
        plots: Vec::new(),
    })
}

fn row(args: &EfficiencyArgs, engine: &Engine, weights: &Weights, count: usize) -> Result<Row, CliError> {
    let [width, height] = [args.size.0, args.size.1].map(|side| side as usize);
    let before = Instant::now();
    let moves = weights.network().config().trajectory.is_some();
    let request = omnix::Request::new(count, height, width).motion(moves);
    let plan = RunPlan::new(weights, &request, engine.caps())?;
    let (layers, all, planned) = (plan.layer_flops(), plan.flops(), plan.peak_bytes());
    let mut session = Session::new(engine, weights, plan, &mut omnix::quiet())?;
    let start = before.elapsed().as_secs_f64();
    let noise: Vec<f32> = (0..3 * width * height).map(|i| ((i * 7919) % 1009) as f32 / 504.5 - 1.0).collect();
    let mut seconds = Vec::with_capacity(args.runs as usize);
    for run in 0..=args.runs {
        let before = Instant::now();
        for image in 0..count {
            session.set_image(image, &noise)?;
        }
        session.run(&mut omnix::quiet())?;
        if run > 0 {
            seconds.push(before.elapsed().as_secs_f64());
        }
    }
    seconds.sort_by(f64::total_cmp);
    let run = seconds[seconds.len() / 2];
    let parameters: usize = weights.checkpoint().tensors().map(|(_, tensor)| tensor.elements()).sum();
    let adds = |flops: u64| flops as f64 / 2e12;
    let measured = memory::peak().map_or(f64::NAN, |bytes| bytes as f64 / MEBI);
    let values = vec![
        parameters as f64 / 1e6,
        adds(layers),
        adds(all),
        planned as f64 / MEBI,
        measured,
        start,
        run,
        run / count as f64,
    ];
    Ok(Row { name: format!("{count} image(s)"), count, values })
}
