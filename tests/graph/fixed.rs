//! What depends on parameters and constants alone is computed once an executable and stays right for all its runs.

use std::ops::ControlFlow;

use omnix_graph::ops::{Binary, Unary};
use omnix_graph::profile::profile;
use omnix_graph::{Graph, Operation as _, Plan, PlanOptions};
use omnix_kernels::resize::{Corners, Filter};
use omnix_tests::gpu;

use crate::support::{feed, prepare, run};

/// A table of positions at the size of `[1, 8, 10, 32]`, made in the middle of the graph, and a layer of a constant; both are read last.
pub(crate) fn table(rows: usize, columns: usize, given: bool) -> Graph {
    let mut g = Graph::new();
    let x = g.input("x", [1, rows, columns, 32]);
    let mut y = g.map(Unary::Relu, x);
    let source = if given { g.input("table", [1, 5, 5, 32]) } else { g.parameter("table", [1, 5, 5, 32]) };
    let positions = g.resize(source, rows, columns, Filter::Bicubic, Corners::HalfPixel).expect("records");
    let codes = g.constant("codes", [4, 16], (0..64).map(|i| (i as f32).sin()).collect());
    let w = g.parameter("w", [32, 16]);
    let codes = g.linear(codes, w, None).expect("records");
    let codes = g.map(Unary::Gelu, codes);
    // Work between the two that wants room.
    for _ in 0..3 {
        let square = g.zip(Binary::Mul, y, y).expect("records");
        y = g.map(Unary::Sigmoid, square);
    }
    let y = g.zip(Binary::Add, y, positions).expect("records");
    let rows = g.reshape(y, [rows * columns / 4, 4 * 32]).expect("records");
    let codes = g.reshape(codes, [4 * 32]).expect("records");
    let y = g.zip(Binary::Add, rows, codes).expect("records");
    g.output(y, "y");
    g
}

#[test]
fn what_no_input_reaches_is_no_part_of_a_run() {
    let graph = table(8, 10, false);
    for fuse in [true, false] {
        let options = PlanOptions::default().fuse(fuse);
        let plan = Plan::new(&graph, &gpu().caps, &options).expect("plans");
        let fixed: Vec<_> = plan.graph.nodes()[..plan.fixed].iter().map(|node| node.op.name()).collect();
        assert_eq!(fixed, if fuse { vec!["resize", "linear"] } else { vec!["resize", "linear", "pointwise"] });
        let work = plan.work().expect("counts");
        let executable = prepare(gpu(), &graph, &options);
        assert_eq!((executable.dispatches(), work.multiply_adds * 2), (work.dispatches, plan.flops()));
        assert_eq!(work.dispatches, plan.graph.nodes().len() - plan.fixed, "each of these nodes is one dispatch");
    }
}

#[test]
fn every_run_reads_what_was_computed_once() {
    let graph = table(8, 10, false);
    let executable = prepare(gpu(), &graph, &PlanOptions::default());
    let mut first: Option<Vec<f32>> = None;
    for other in [false, true, false] {
        feed(&executable, &graph);
        if other {
            executable.write("x", &vec![0.25; 8 * 10 * 32]).expect("writes");
        }
        executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
        let y = executable.read("y").expect("reads");
        match &first {
            None => first = Some(y),
            Some(first) => assert_eq!(*first == y, !other),
        }
    }
    // As a part of the run, with the table an input.
    let given = table(8, 10, true);
    let as_input = prepare(gpu(), &given, &PlanOptions::default());
    assert!(as_input.plan().fixed < executable.plan().fixed);
    feed(&as_input, &given);
    let source = crate::support::Seeded(&graph);
    let numbers = omnix_graph::ParameterSource::read(&source, "table").expect("seeded");
    as_input.write("table", &numbers).expect("writes");
    let mut encoder = gpu().device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    as_input.encode(&mut encoder);
    gpu().queue.submit([encoder.finish()]);
    assert!(first.is_some_and(|first| first == as_input.read("y").expect("reads")));
    // And as the host records it.
    let again = prepare(gpu(), &graph, &PlanOptions::default());
    feed(&again, &graph);
    let mut encoder = gpu().device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
    again.encode(&mut encoder);
    gpu().queue.submit([encoder.finish()]);
    assert_eq!(run(gpu(), &graph, &PlanOptions::default()), again.read("y").expect("reads"));
}

#[test]
fn the_profile_of_a_run_names_its_own_nodes() {
    let graph = table(8, 10, false);
    let executable = prepare(gpu(), &graph, &PlanOptions::default());
    feed(&executable, &graph);
    let plan = executable.plan();
    let nodes = &plan.graph.nodes()[plan.fixed..];
    let of_run: Vec<_> = nodes.iter().map(|n| (plan.graph.value_name(n.outputs[0]), n.op.name())).collect();
    let spans = profile(&executable).expect("profiles");
    assert_eq!(spans.iter().map(|s| (&*s.name, s.op)).collect::<Vec<_>>(), of_run);
    assert!(plan.fixed > 0 && spans.iter().all(|s| s.op != "resize"));
    assert_eq!(run(gpu(), &graph, &PlanOptions::default()), executable.read("y").expect("reads"));
}

#[test]
fn an_output_that_no_input_reaches_is_written_by_every_run() {
    let mut g = Graph::new();
    let table = g.parameter("table", [16, 32]);
    let y = g.map(Unary::Relu, table);
    g.output(y, "y");
    let executable = prepare(gpu(), &g, &PlanOptions::default());
    let once = |overwrite: bool| {
        if overwrite {
            let slice = executable.slice("y").expect("an output");
            gpu().queue.write_buffer(&slice.buffer, slice.offset, &vec![0xff; slice.size as usize]);
        }
        executable.run(&mut |_, _| ControlFlow::Continue(())).expect("runs");
        executable.read("y").expect("reads")
    };
    let first = once(false);
    assert!(first.iter().any(|v| *v > 0.0) && first == once(true));
}
