//! Weights reach the device in groups, in place or through staging buffers.

use std::ops::ControlFlow;

use omnix_graph::{Graph, GraphError, Plan, PlanOptions, WeightStore};
use omnix_kernels::{Gpu, WeightType, adapter};
use omnix_tests::gpu;

use crate::support::{Seeded, run};

/// Layers of 12 and 25 MB and small vectors: several groups, of one tensor and of more.
fn layers() -> Graph {
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

/// The same adapter as a host would open it that does not know of buffers in place.
fn lent() -> Gpu {
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
    assert!(!lent.maps_buffers());
    let cpu = gpu().device.adapter_info().device_type == wgpu::DeviceType::Cpu;
    assert_eq!(gpu().maps_buffers(), cpu, "software devices are opened with mappable buffers");
    for storage in [WeightType::F32, WeightType::F16, WeightType::I8] {
        let options = PlanOptions { storage, ..PlanOptions::default() };
        let bits = |gpu: &Gpu| run(gpu, &graph, &options).iter().map(|v| v.to_bits()).collect::<Vec<_>>();
        let staged = bits(&lent);
        assert!(staged.iter().any(|bits| *bits != 0));
        assert_eq!(bits(&gpu().with_caps(lent.caps.clone())), staged, "{storage:?}");
    }
}

#[test]
fn progress_hears_every_group_and_may_break_off() {
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
    let mut groups = 0;
    let stopped = WeightStore::load(gpu(), &Seeded(&graph), &plan.weights, &mut |_, _| {
        groups += 1;
        if groups == 2 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert!(matches!(stopped, Err(GraphError::Interrupted)) && groups == 2);
}
