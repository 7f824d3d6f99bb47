//! Weights that pass through while a plan runs: the bits of weights that stay, in less memory.

use std::borrow::Cow;
use std::ops::ControlFlow;

use omnix_graph::{Bindings, Graph, GraphError, ParameterSource, Plan, PlanOptions, Streamed};
use omnix_kernels::caps::UNIFORM_WINDOW;
use omnix_kernels::{Gpu, WeightType};
use omnix_tests::gpu;

use crate::support::{Seeded, feed, run, two_blocks};
use crate::upload::{Damaged, layers, lent};

fn go(_: u64, _: u64) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn streamed(gpu: &Gpu, graph: &Graph, options: &PlanOptions) -> Streamed {
    let plan = Plan::new(graph, &gpu.caps, &options.streamed(true)).expect("plans");
    let streamed = Streamed::new(gpu, plan, &Bindings::default()).expect("prepares");
    feed(&streamed, graph);
    streamed
}

#[test]
fn passing_weights_give_the_bits_of_weights_that_stay() {
    let (layers, blocks, lent) = (layers(), two_blocks(6, 75, (2, 32)), lent());
    for (graph, storage, parts) in [
        (&layers, WeightType::F32, 1),
        (&layers, WeightType::F16, 1),
        (&layers, WeightType::I8, 1),
        // Chains in chunks: each reads its weights again.
        (&blocks, WeightType::F32, 4),
    ] {
        let options = PlanOptions::default().storage(storage).parts(parts);
        let windows = lent.with_caps(lent.caps.clone().with_vector_registers(16));
        for gpu in [gpu(), &lent, &windows] {
            let stay = run(gpu, graph, &options);
            let streamed = streamed(gpu, graph, &options);
            for _ in 0..2 {
                streamed.run(&Seeded(graph), &mut go).expect("runs");
                let passed = streamed.read("y").expect("reads");
                assert!(stay.iter().map(|v| v.to_bits()).eq(passed.iter().map(|v| v.to_bits())), "{storage:?} {parts}");
            }
        }
    }
}

/// Layers of 4, 6, 9.75, 3.25 and 9 MiB.
fn sizes() -> Graph {
    let mut g = Graph::new();
    let mut x = g.input("x", [5, 512]);
    let mut inputs = 512;
    for (i, out) in [2048, 768, 3328, 256, 9216].into_iter().enumerate() {
        let w = g.parameter(&format!("{i}"), [out, inputs]);
        x = g.linear(x, w, None).expect("records");
        inputs = out;
    }
    g.output(x, "y");
    g
}

#[test]
fn passing_weights_take_no_more_than_was_planned() {
    // The driver's own memory is counted by wgpu, imports are not.
    let (lent, graph) = (lent(), sizes());
    // With 16 registers, lavapipe reads weights through uniform windows, for which buffers are longer.
    for lent in [16, 32].map(|registers| lent.with_caps(lent.caps.clone().with_vector_registers(registers))) {
        passing_weights_of(&lent, &graph);
    }
}

fn passing_weights_of(lent: &Gpu, graph: &Graph) {
    let live = |gpu: &Gpu| {
        let report = gpu.device.generate_allocator_report().expect("counts");
        report.allocations.iter().filter(|one| one.name == "weights").map(|one| one.size).sum::<u64>()
    };
    let streamed = streamed(lent, graph, &PlanOptions::default());
    assert_eq!(live(lent), 0);
    let mut most = 0;
    let mut listen = |_, _| {
        most = most.max(live(lent));
        ControlFlow::Continue(())
    };
    streamed.run(&Seeded(graph), &mut listen).expect("runs");
    let plan = streamed.plan();
    // The second and third together are the most of two neighbours.
    let windows = if lent.caps.weight_windows() { 2 * UNIFORM_WINDOW } else { 0 };
    assert_eq!((plan.weight_bytes(), plan.resident_weight_bytes()), (32 << 20, (63 << 18) + windows));
    // One stretch's may be gone before the next but one's come, if the device is quick.
    assert!((39 << 18..=plan.resident_weight_bytes()).contains(&most), "{most}");
    assert_eq!(live(lent), 0, "given back");
}

#[test]
fn a_damaged_weight_and_a_listener_stop_the_run_and_the_device_goes_on() {
    let (graph, lent) = (layers(), lent());
    for gpu in [gpu(), &lent] {
        let streamed = streamed(gpu, &graph, &PlanOptions::default());
        let failed = streamed.run(&Damaged(Seeded(&graph), &["c.", "d.weight"]), &mut go);
        let Err(GraphError::Parameter { name, .. }) = failed else { panic!("{failed:?}") };
        assert_eq!(name, "c.weight");
        let mut reports = 0;
        let mut count = |_, _| {
            reports += 1;
            ControlFlow::Continue(())
        };
        streamed.run(&Seeded(&graph), &mut count).expect("runs");
        // When a stretch is submitted, and before that when its weights are written.
        assert!(reports > 7, "{reports}");
        for stop_at in 1..=reports {
            let mut heard = 0;
            let stopped = streamed.run(&Seeded(&graph), &mut |_, _| {
                heard += 1;
                if heard == stop_at { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
            });
            assert!(matches!(stopped, Err(GraphError::Interrupted)) && heard == stop_at, "{stop_at}: {stopped:?}");
        }
        streamed.run(&Seeded(&graph), &mut go).expect("runs");
        assert_eq!(streamed.read("y").expect("reads"), run(gpu, &graph, &PlanOptions::default()));
    }
}

/// Counts how often a tensor is read.
struct Counting<'a>(Seeded<'a>, std::sync::Mutex<Vec<String>>);

impl ParameterSource for Counting<'_> {
    fn read(&self, name: &str) -> Result<Cow<'_, [f32]>, Box<dyn std::error::Error + Send + Sync>> {
        self.1.lock().expect("no reader panics").push(name.to_owned());
        self.0.read(name)
    }
}

#[test]
fn a_run_reads_each_weight_once() {
    let graph = layers();
    let streamed = streamed(gpu(), &graph, &PlanOptions::default());
    let source = Counting(Seeded(&graph), std::sync::Mutex::default());
    streamed.run(&source, &mut go).expect("runs");
    let mut read = source.1.into_inner().expect("no reader panics");
    read.sort_unstable();
    assert_eq!(read, ["a.bias", "a.weight", "b.bias", "b.weight", "c.bias", "c.weight", "d.bias", "d.weight"]);
    let plan = streamed.plan();
    assert!(plan.resident_weight_bytes() < plan.weight_bytes() * 4 / 5);
}

#[test]
fn a_budget_is_for_passing_weights_too() {
    let graph = two_blocks(64, 75, (2, 32));
    let taken = |plan: &Plan| plan.working_bytes() + plan.resident_weight_bytes();
    let options = |budget| PlanOptions::default().budget(budget).streamed(true);
    let plan = |budget| Plan::new(&graph, &gpu().caps, &options(budget));
    let unbounded = PlanOptions::default().streamed(true);
    let free = taken(&Plan::new(&graph, &gpu().caps, &unbounded).expect("plans"));
    let tight = plan(free * 17 / 20).expect("fits in chunks");
    assert!(tight.parts > 1 && taken(&tight) <= free * 17 / 20, "{} of {free}", taken(&tight));
    let Err(GraphError::Budget { least, .. }) = plan(1000) else { panic!("1000 bytes cannot do") };
    assert_eq!(taken(&plan(least).expect("the least that was named works")), least);
}
