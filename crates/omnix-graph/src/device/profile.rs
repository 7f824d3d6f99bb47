//! Time of every node by timestamp queries, and the Chrome trace of it (`chrome://tracing`, Perfetto).

use std::io::{self, Write};

use omnix_kernels::readback;

use super::exec::Executable;
use crate::error::GraphError;
use crate::graph::Operation as _;

/// One timed piece of work.
#[derive(Clone, Debug)]
pub struct Span {
    /// Name of the node's first output.
    pub name: String,
    /// Name of the operation.
    pub op: &'static str,
    /// Start on the device's clock, in nanoseconds from the first span's start.
    pub start_ns: f64,
    /// Length in nanoseconds.
    pub length_ns: f64,
    /// Operations of the piece.
    pub flops: u64,
}

/// WebGPU allows 4,096 queries in a set; each span takes two.
const SPANS_PER_SET: usize = 2_048;

/// Runs `executable` once, one pass and two timestamps for each piece, and waits.
///
/// # Errors
/// [`GraphError::Kernel`] when the device has no timestamp queries, or is lost.
pub fn profile(executable: &Executable) -> Result<Vec<Span>, GraphError> {
    let gpu = executable.gpu();
    if !gpu.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
        return Err(omnix_kernels::KernelError::Unsupported {
            kernel: "profile",
            reason: "the device has no timestamp queries".to_owned(),
        }
        .into());
    }
    let period = f64::from(gpu.queue.get_timestamp_period());
    let mut spans = Vec::new();
    for pieces in executable.pieces().chunks(SPANS_PER_SET) {
        let count = pieces.len() as u32 * 2;
        let set = gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: None,
            ty: wgpu::QueryType::Timestamp,
            count,
        });
        let bytes = u64::from(count) * 8;
        let resolved =
            gpu.buffer("timestamps", bytes, wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC)?;
        let mut encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (i, piece) in pieces.iter().enumerate() {
            let timestamp_writes = Some(wgpu::ComputePassTimestampWrites {
                query_set: &set,
                beginning_of_pass_write_index: Some(i as u32 * 2),
                end_of_pass_write_index: Some(i as u32 * 2 + 1),
            });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor { label: None, timestamp_writes });
            executable.program().encode(&mut pass, piece.dispatches.clone());
        }
        encoder.resolve_query_set(&set, 0..count, &resolved, 0);
        gpu.queue.submit([encoder.finish()]);
        let ticks: Vec<u64> = readback::read(gpu, &resolved.into())?;
        let graph = &executable.plan().graph;
        for (piece, pair) in pieces.iter().zip(ticks.chunks_exact(2)) {
            spans.push(Span {
                name: graph.value_name(graph.nodes()[piece.node].outputs[0]).to_owned(),
                op: graph.nodes()[piece.node].op.name(),
                start_ns: pair[0] as f64 * period,
                length_ns: pair[1].saturating_sub(pair[0]) as f64 * period,
                flops: piece.flops,
            });
        }
    }
    let origin = spans.iter().map(|s| s.start_ns).fold(f64::INFINITY, f64::min);
    spans.iter_mut().for_each(|s| s.start_ns -= origin);
    Ok(spans)
}

/// Writes spans as a Chrome trace, one complete event a span, microseconds.
///
/// # Errors
/// When `out` cannot be written.
pub fn write_chrome_trace(spans: &[Span], out: &mut dyn Write) -> io::Result<()> {
    let events: Vec<_> = spans
        .iter()
        .map(|s| {
            serde_json::json!({
                "name": s.name, "cat": s.op, "ph": "X", "pid": 1, "tid": 1,
                "ts": s.start_ns / 1e3, "dur": s.length_ns / 1e3,
                "args": { "op": s.op, "gflop": s.flops as f64 / 1e9 },
            })
        })
        .collect();
    serde_json::to_writer(&mut *out, &serde_json::json!({ "traceEvents": events, "displayTimeUnit": "ms" }))?;
    out.flush()
}
