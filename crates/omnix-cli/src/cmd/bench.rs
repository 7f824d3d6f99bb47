//! `omnix bench`: the heavy kernels at the small network's shapes, the small network at 504x280 with random weights, and
//! where its time goes; on software devices beside the processor's own ceilings, measured in the same run.
//!
//! The kernels one by one, at many shapes and for every family of variants, are in `benches/` of the repository.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use clap::Args;
use omnix::WeightType;
use omnix::bench::{NetworkBench, Seconds};
use omnix::graph::profile::{Span, write_chrome_trace};
use omnix::kernels::attention::Attention;
use omnix::kernels::bench::{Ceilings, Effort, time};
use omnix::kernels::layer_norm::LayerNorm;
use omnix::kernels::linear::Linear;
use omnix::kernels::run::{HostArg, upload};
use omnix::kernels::{Activation, Dispatch, Gpu, PackedWeights};
use omnix::model::config::NetworkConfig;
use serde_json::{Value, json};

use crate::args::DeviceArgs;
use crate::error::CliError;
use crate::ui::{self, Ui};

/// Arguments of `omnix bench`.
#[derive(Debug, Args)]
pub(crate) struct BenchArgs {
    /// One run of everything, and the network with one image of 140x84: shows that it works.
    #[arg(long)]
    quick: bool,
    /// Write a Chrome trace (chrome://tracing, Perfetto) of one run, one span for each piece of work.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    #[command(flatten)]
    device: DeviceArgs,
    /// One JSON object a row on standard output.
    #[arg(long)]
    pub(crate) json: bool,
}

/// Rows and columns of a picture: the shape of a wide video at Depth Anything 3's default.
const SIZE: (usize, usize) = (280, 504);
/// The same with `--quick`.
const QUICK_SIZE: (usize, usize) = (84, 140);

/// The least that a measured rate is compared with.
#[derive(Clone, Copy)]
enum Work {
    Flops(u64),
    Bytes(u64),
}

/// Where rows go: a table or events.
struct Table<'a> {
    ui: &'a mut Ui,
    ceilings: Option<Ceilings>,
}

/// Prints the tables.
pub(crate) fn run(args: &BenchArgs, ui: &mut Ui) -> Result<(), CliError> {
    let engine = args.device.open()?;
    let info = engine.info();
    let software = engine.gpu().device.adapter_info().device_type == omnix::wgpu::DeviceType::Cpu;
    // The processors bound a software device alone.
    let ceilings = software.then(Ceilings::measure);
    ui.event("device", serde_json::to_value(&info).unwrap_or_default());
    if ui.json() {
        let (flops, copy) = (ceilings.map(|c| c.flops), ceilings.map(|c| c.copy));
        ui.event("ceilings", json!({ "flops": flops, "copy_bytes": copy }));
    } else {
        ui::print(&format!(
            "{} ({}), {} variants, omnix {}",
            info.name,
            info.driver,
            info.tier,
            env!("CARGO_PKG_VERSION")
        ))?;
        if let Some(c) = &ceilings {
            let (gflops, gbytes) = (c.flops / 1e9, c.copy / 1e9);
            ui::print(&format!(
                "Ceilings, {} threads: {gflops:.0} GFLOP/s ({}), copy {gbytes:.1} GB/s.",
                c.threads, c.method
            ))?;
            ui::print(
                "\"quiet\" is by processor time over threads, what an idle machine would show; it is what is compared with the \
                 ceiling, where there is one.",
            )?;
        }
    }
    let mut table = Table { ui, ceilings };
    kernels(&mut table, engine.gpu(), args.quick)?;
    table.head("network", "images")?;
    let config = NetworkConfig::small();
    let counts: &[usize] = if args.quick { &[1] } else { &[1, 2, 4] };
    let (height, width) = if args.quick { QUICK_SIZE } else { SIZE };
    let mut last = None;
    for &images in counts {
        let network = NetworkBench::new(&engine, &config, images, height, width)?;
        let t = network.time(if args.quick { 1 } else { 3 })?;
        let case = format!("{images} of {width}x{height}");
        table.row("encoder and cameras", &case, t.backbone, Work::Flops(t.backbone_flops))?;
        table.row("depth heads", &case, t.head, Work::Flops(t.head_flops))?;
        table.row(&config.name, &case, t.backbone + t.head, Work::Flops(t.backbone_flops + t.head_flops))?;
        last = Some(network);
    }
    let Some(network) = last else { return Ok(()) };
    match network.spans() {
        Ok(spans) => {
            operations(&mut table, &spans, *counts.last().unwrap_or(&1))?;
            if let Some(path) = &args.trace {
                trace(path, &spans)?;
                table.ui.note(&format!("trace of one run: {}", path.display()));
            }
        }
        Err(error) if args.trace.is_some() => return Err(error.into()),
        Err(error) => table.ui.note(&format!("no times of single operations: {error}")),
    }
    Ok(())
}

impl Table<'_> {
    fn head(&mut self, what: &str, case: &str) -> Result<(), CliError> {
        if self.ui.json() {
            return Ok(());
        }
        ui::print(&format!("\n| {what} | {case} | ms | rate | quiet | of ceiling |\n|---|---|---|---|---|---|"))
    }

    fn row(&mut self, name: &str, case: &str, seconds: Seconds, work: Work) -> Result<(), CliError> {
        let (amount, unit, ceiling) = match work {
            Work::Flops(n) => (n as f64, "GFLOP/s", self.ceilings.map(|c| c.flops)),
            Work::Bytes(n) => (n as f64, "GB/s", self.ceilings.map(|c| c.copy)),
        };
        // Processor time says nothing about a device that is not the processor.
        let quiet = seconds.quiet.filter(|_| self.ceilings.is_some()).map(|s| amount / s);
        let rate = amount / seconds.wall;
        let fraction = ceiling.map(|c| quiet.unwrap_or(rate) / c);
        if self.ui.json() {
            let row: Value = json!({
                "name": name, "case": case, "seconds": seconds.wall, "rate": rate, "quiet_rate": quiet,
                "unit": unit.trim_start_matches('G'), "of_ceiling": fraction,
            });
            self.ui.event("row", row);
            return Ok(());
        }
        let in_giga = |rate: Option<f64>| {
            rate.filter(|r| *r > 0.0).map_or_else(|| "-".to_owned(), |r| format!("{:.1} {unit}", r / 1e9))
        };
        let share = fraction.filter(|f| *f > 0.0).map_or_else(|| "-".to_owned(), |f| format!("{:.0} %", 100.0 * f));
        let (rate, quiet) = (in_giga(Some(rate)), in_giga(quiet));
        ui::print(&format!("| {name} | {case} | {:.2} | {rate} | {quiet} | {share} |", 1e3 * seconds.wall))
    }
}

/// The three kernels that take most of the time.
fn kernels(table: &mut Table<'_>, gpu: &Gpu, quick: bool) -> Result<(), CliError> {
    table.head("kernel", "case")?;
    let effort = if quick { Effort::ONCE } else { Effort::TABLE };
    let mut measure = |name: &str, case: &str, work: Work, dispatches: &[Dispatch], args: &[HostArg<'_>]| {
        let timing = time(gpu, dispatches, &upload(gpu, args)?, effort)?;
        table.row(name, case, Seconds { wall: timing.wall, quiet: timing.cpu }, work)
    };
    for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
        let (m, n, k) = (721, 1536, 384);
        let weights = PackedWeights { k, n, storage };
        let spec = Linear { m, weights, act: Activation::None, bias: true, gamma: false, residual: false };
        let (x, bias, out) = (numbers(m * k), numbers(n), HostArg::Out((m * n) as usize));
        let packed = weights.pack(|row, column| ((row * 31 + column * 17) % 101) as f32 * 0.01 - 0.5);
        let args =
            [HostArg::F32(&x), HostArg::Bytes(&packed), HostArg::F32(&bias), HostArg::Out(1), HostArg::Out(1), out];
        let case = format!("{m}x{n}x{k} {storage:?}");
        measure("linear", &case, Work::Flops(spec.flops()), &spec.record(&gpu.caps)?, &args)?;
    }
    for images in [1, 4] {
        let keys = 721 * images;
        let spec = Attention { groups: 1, heads: 6, head_dim: 64, nq: keys, nk: keys, keep_state: false };
        let (q, kv) = (numbers(spec.q_words() as u32), numbers(spec.kv_words() as u32));
        let state = HostArg::Out((spec.state_bytes(&gpu.caps) / 4) as usize);
        let args =
            [HostArg::F32(&q), HostArg::F32(&kv), HostArg::F32(&kv), HostArg::Out(spec.out_words() as usize), state];
        let case = format!("6 heads of 64, {keys} keys");
        measure("attention", &case, Work::Flops(spec.flops()), &spec.record(&gpu.caps)?, &args)?;
    }
    let (m, c) = (4 * 721, 384);
    let spec = LayerNorm { m, c, eps: 1e-6, act: Activation::None, weight: true, bias: true };
    let (x, w) = (numbers(m * c), numbers(c));
    let args = [HostArg::F32(&x), HostArg::F32(&w), HostArg::F32(&w), HostArg::Out(x.len())];
    measure("layer_norm", &format!("{m}x{c}"), Work::Bytes(spec.bytes()), &spec.record(&gpu.caps)?, &args)
}

/// Numbers from -0.5 to 0.5 that repeat after 101.
fn numbers(count: u32) -> Vec<f32> {
    (0..count).map(|i| (i.wrapping_mul(37) % 101) as f32 * 0.01 - 0.5).collect()
}

/// Time of every kind of operation in one run, as the device's clock sees it.
fn operations(table: &mut Table<'_>, spans: &[Span], images: usize) -> Result<(), CliError> {
    table.head("operation", "in one run")?;
    let mut kinds: BTreeMap<&str, (f64, u64, usize)> = BTreeMap::new();
    let mut previous = None;
    for span in spans {
        let kind = kinds.entry(span.op).or_default();
        kind.0 += span.length_ns * 1e-9;
        // A node in several pieces states its operations with each.
        if previous.replace(&span.name) != Some(&span.name) {
            kind.1 += span.flops;
        }
        kind.2 += 1;
    }
    let mut kinds: Vec<_> = kinds.into_iter().collect();
    kinds.sort_by(|a, b| b.1.0.total_cmp(&a.1.0));
    for (op, (seconds, flops, count)) in kinds {
        // The heads' part is that of one image.
        let case = format!("{count} calls, {images} image(s), heads of one");
        table.row(op, &case, Seconds { wall: seconds, quiet: None }, Work::Flops(flops))?;
    }
    Ok(())
}

fn trace(path: &Path, spans: &[Span]) -> Result<(), CliError> {
    let wrong = |source| CliError::File { path: path.to_owned(), source };
    let mut out = std::io::BufWriter::new(std::fs::File::create(path).map_err(wrong)?);
    write_chrome_trace(spans, &mut out).map_err(wrong)
}
