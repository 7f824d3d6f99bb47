//! Where the time of a step goes, by operation, on the default device:
//!
//! `cargo run --release -p omnix-train --example profile_step -- recipes/smoke.toml [trace.json]`
//!
//! The trace opens in a browser's `chrome://tracing` or in Perfetto.

#![expect(clippy::print_stdout, reason = "an example prints what it found")]

use std::collections::BTreeMap;
use std::path::PathBuf;

use omnix_graph::profile::{Span, write_chrome_trace};
use omnix_kernels::{Gpu, adapter};
use omnix_train::Mixture;
use omnix_train::device::ready;
use omnix_train::{Session, Step as _, read_config};

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let mut arguments = std::env::args_os().skip(1).map(PathBuf::from);
    let recipe = read_config(&arguments.next().ok_or("which recipe?")?)?;
    let samples = Mixture::of(&recipe.config, false)?;
    let folder = std::env::temp_dir().join(format!("omnix-profile-{}", std::process::id()));
    let session = Session::open(recipe, &folder)?;
    let adapter = adapter::choose(None)?;
    let (device, queue) = adapter::open(&adapter)?;
    let mut step = ready(&session, &Gpu::new(&device, &queue), None)?;
    // The first runs compile shaders.
    for number in 0..2 {
        step.train(&samples.draw(number)?.sample, number)?;
    }
    let [step, update] = step.profile()?;
    table("forward and backward", &step);
    table("update", &update);
    if let Some(path) = arguments.next() {
        write_chrome_trace(&step, &mut std::fs::File::create(path)?)?;
    }
    std::fs::remove_dir_all(folder)?;
    Ok(())
}

/// Milliseconds and billions of operations a second, by operation and then of the longest pieces.
fn table(what: &str, spans: &[Span]) {
    let all: f64 = spans.iter().map(|span| span.length_ns).sum();
    println!("{what}: {:.1} ms in {} pieces", all / 1e6, spans.len());
    let mut by_op: BTreeMap<&str, (usize, f64, u64)> = BTreeMap::new();
    for span in spans {
        let row = by_op.entry(span.op).or_default();
        *row = (row.0 + 1, row.1 + span.length_ns, row.2 + span.flops);
    }
    let mut rows: Vec<_> = by_op.into_iter().collect();
    rows.sort_by(|a, b| b.1.1.total_cmp(&a.1.1));
    for (op, (count, ns, flops)) in rows.iter().take(40) {
        println!(
            "  {op:24} {count:5} x {:9.2} ms {:8.3} GFLOP {:8.1} GFLOP/s",
            ns / 1e6,
            *flops as f64 / 1e9,
            *flops as f64 / ns
        );
    }
    let mut longest: Vec<&Span> = spans.iter().collect();
    longest.sort_by(|a, b| b.length_ns.total_cmp(&a.length_ns));
    for span in longest.iter().take(40) {
        println!(
            "    {:8.2} ms {:8.1} GFLOP/s  {} {}",
            span.length_ns / 1e6,
            span.flops as f64 / span.length_ns,
            span.op,
            span.name
        );
    }
}
