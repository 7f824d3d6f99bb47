//! Weights reach the device in pieces, in place or through staging buffers.

use std::borrow::Cow;
use std::ops::ControlFlow;

use omnix_graph::{Graph, GraphError, ParameterSource, Plan, PlanOptions, WeightStore};
use omnix_kernels::readback::read;
use omnix_kernels::{Gpu, KernelError, WeightType, adapter};
use omnix_tests::gpu;

use crate::support::{Seeded, run};

/// Layers of 12 and 25 MB and small vectors: several pieces, of one tensor and of more.
pub(crate) fn layers() -> Graph {
    let mut g = Graph::new();
    let mut x = g.input("x", [5, 768]);
    for (name, [out, inputs]) in [("a", [4096, 768]), ("b", [1536, 4096]), ("c", [2048, 1536]), ("d", [33, 2048])] {
        let (w, b) =
            (g.parameter(&format!("{name}.weight"), [out, inputs]), g.parameter(&format!("{name}.bias"), [out]));
        x = g.linear(x, w, Some(b)).expect("records");
    }
    g.output(x, "y");
    g
}

/// The same adapter as a host would open it that does not know of imports.
pub(crate) fn lent() -> Gpu {
    let wanted = std::env::var("OMNIX_DEVICE").ok();
    let adapter = adapter::choose(wanted.as_deref()).expect("a device");
    let descriptor = wgpu::DeviceDescriptor {
        required_features: adapter.features() & adapter::wanted_features(),
        required_limits: adapter.limits(),
        ..wgpu::DeviceDescriptor::default()
    };
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).expect("opens");
    Gpu::new(&device, &queue)
}

#[test]
fn staging_buffers_and_buffers_in_place_give_the_same_bits() {
    let (graph, lent) = (layers(), lent());
    assert!(!lent.imports());
    // Weights through uniform windows need room behind the last of a buffer.
    let windows = lent.with_caps(lent.caps.clone().with_vector_registers(16));
    // Not so SwiftShader, which has the extension but says that no buffer can be imported.
    let lavapipe = gpu().device.adapter_info().name.starts_with("llvmpipe");
    assert_eq!(gpu().imports(), lavapipe && cfg!(target_os = "linux"), "lavapipe is opened so that it imports memory");
    for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
        let options = PlanOptions::default().storage(storage);
        let bits = |gpu: &Gpu| run(gpu, &graph, &options).iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        for lent in [&lent, &windows] {
            let staged = bits(lent);
            assert!(staged.iter().any(|bits| *bits != 0));
            assert_eq!(bits(&gpu().with_caps(lent.caps.clone())), staged, "{storage:?}");
        }
    }
}

#[test]
fn written_memory_becomes_a_buffer_by_import_or_by_copy() {
    use wgpu::BufferUsages;

    let lent = lent();
    // Below and above a huge page; a usage that imports have, and one that they do not.
    for (gpu, bytes, usage) in [
        (gpu(), 20, BufferUsages::STORAGE),
        (gpu(), (3 << 20) + 4, BufferUsages::STORAGE | BufferUsages::UNIFORM),
        (gpu(), 5 << 20, BufferUsages::STORAGE | BufferUsages::INDIRECT),
        (&lent, (3 << 20) + 4, BufferUsages::STORAGE),
    ] {
        let numbers: Vec<u32> = (0..bytes as u32 / 4).map(|i| i.wrapping_mul(2_654_435_761)).collect();
        let mut memory = gpu.host_memory("test", bytes).expect("little memory");
        memory.copy_from_slice(bytemuck::cast_slice(&numbers));
        let buffer = gpu.import("test", memory, usage | BufferUsages::COPY_SRC).expect("little memory");
        assert_eq!((buffer.size(), buffer.usage().contains(usage)), (bytes, true));
        assert!(read::<u32>(gpu, &buffer.into()).expect("reads") == numbers, "{bytes} bytes, {usage:?}");
    }
    let error = gpu().host_memory("test", 1 << 60);
    assert!(matches!(error, Err(KernelError::OutOfMemory { bytes, .. }) if bytes == 1 << 60), "{error:?}");
}

/// A source that cannot read what belongs to some layers.
pub(crate) struct Damaged<'a>(pub(crate) Seeded<'a>, pub(crate) &'static [&'static str]);

impl ParameterSource for Damaged<'_> {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        if self.1.iter().any(|layer| name.starts_with(layer)) {
            return Err("damaged".into());
        }
        self.0.read(name)
    }
}

#[test]
fn the_first_damaged_tensor_is_named_and_the_device_goes_on() {
    let (graph, lent) = (layers(), lent());
    for gpu in [gpu(), &lent] {
        let plan = Plan::new(&graph, &gpu.caps, &PlanOptions::default()).expect("plans");
        let source = Damaged(Seeded(&graph), &["c.", "d.weight"]);
        let failed = WeightStore::load(gpu, &source, &plan.weights, &mut |_, _| ControlFlow::Continue(()));
        let Err(GraphError::Parameter { name, .. }) = failed else { panic!("{failed:?}") };
        assert_eq!(name, "c.weight");
        assert!(run(gpu, &graph, &PlanOptions::default()).iter().all(|v| v.is_finite()));
    }
}

#[test]
fn progress_hears_every_piece_and_may_break_off() {
    let graph = layers();
    let plan = Plan::new(&graph, &gpu().caps, &PlanOptions::default()).expect("plans");
    let mut heard = Vec::new();
    let store = WeightStore::load(gpu(), &Seeded(&graph), &plan.weights, &mut |done, total| {
        heard.push((done, total));
        ControlFlow::Continue(())
    })
    .expect("loads");
    assert!(heard.len() == 3 && heard.is_sorted_by(|a, b| a.0 < b.0), "{heard:?}");
    assert!(heard.last().is_some_and(|(done, total)| done == total && *total <= store.bytes()), "{heard:?}");
    let mut pieces = 0;
    let stopped = WeightStore::load(gpu(), &Seeded(&graph), &plan.weights, &mut |_, _| {
        pieces += 1;
        if pieces == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(GraphError::Interrupted)) && pieces == 2);
}

/// A source with one number of one tensor replaced.
struct With<'a>(Seeded<'a>, &'static str, usize, f32);

impl ParameterSource for With<'_> {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        let mut numbers = self.0.read(name)?.into_owned();
        if name == self.1 {
            numbers[self.2] = self.3;
        }
        Ok(numbers.into())
    }
}

#[test]
fn a_weight_beyond_f16_is_named_by_its_place_in_the_checkpoint() {
    let mut g = Graph::new();
    let (x, picture) = (g.input("x", [2, 12]), g.input("picture", [1, 6, 6, 4]));
    // Rows of a tensor, columns of another, a convolution, and vectors, which stay f32.
    let rows = g.parameter_rows("rows", [40, 12], 8..40);
    let (columns, bias) = (g.parameter_columns("columns", [8, 44], 12..44), g.parameter("bias", [8]));
    let taps = g.parameter("taps", [5, 4, 3, 3]);
    let y = g.linear(x, rows, None).expect("records");
    let y = g.linear(y, columns, Some(bias)).expect("records");
    let map = g.conv2d(picture, taps, None, 1, 1).expect("records");
    g.output(y, "y");
    g.output(map, "map");
    let load = |storage, name, at, value| {
        let options = PlanOptions::default().storage(storage);
        let plan = Plan::new(&g, &gpu().caps, &options).expect("plans");
        let source = With(Seeded(&g), name, at, value);
        WeightStore::load(gpu(), &source, &plan.weights, &mut |_, _| ControlFlow::Continue(())).map(|_| ())
    };
    for (name, at, place) in [
        ("rows", 8 * 12 + 5, "[8, 5]"),
        ("columns", 3 * 44 + 40, "[3, 40]"),
        ("taps", ((2 * 4 + 3) * 3 + 1) * 3 + 2, "[2, 3, 1, 2]"),
    ] {
        let error = load(WeightType::F16, name, at, 70000.0).expect_err("does not fit").to_string();
        assert_eq!(error, format!("weight `{name}{place}` = 70000 does not fit in f16; store it as f32"));
        assert!(load(WeightType::F16, name, at, -65504.0).is_ok(), "{name}");
        assert!(load(WeightType::F32, name, at, 70000.0).is_ok(), "{name}");
        // int8 is for linear layers; a convolution's weights are f16 then.
        assert_eq!(load(WeightType::I8, name, at, -1e9).is_err(), name == "taps");
    }
    // What the graph does not read, and vectors.
    assert!(load(WeightType::F16, "rows", 0, 70000.0).is_ok() && load(WeightType::F16, "bias", 1, 70000.0).is_ok());
}
