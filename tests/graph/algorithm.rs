//! A convolution is computed by the algorithm that suits it, and is the same convolution; a plan says which kernels it needs.

use omnix_graph::graph::WeightForm;
use omnix_graph::ops::Op;
use omnix_graph::{Graph, Plan, PlanOptions};
use omnix_kernels::{Caps, Tier, WeightType};
use omnix_tests::{assert_close, tiers};

use crate::support::run;

/// Two convolutions with a ReLU between them and an addition; the second is too narrow for Winograd's algorithm.
fn graph() -> Graph {
    let mut g = Graph::new();
    let x = g.input("x", [2, 44, 45, 128]);
    let (w1, b1, w2) =
        (g.parameter("w1", [128, 128, 3, 3]), g.parameter("b1", [128]), g.parameter("w2", [8, 128, 3, 3]));
    let y = g.conv2d(x, w1, Some(b1), 1, 1).expect("conv");
    let y = g.add_values(y, x).expect("residual");
    let y = g.conv2d(y, w2, None, 1, 1).expect("narrow");
    g.output(y, "y");
    g
}

fn forms(caps: &Caps, storage: WeightType) -> Vec<WeightForm> {
    let plan = Plan::new(&graph(), caps, &PlanOptions::default().storage(storage)).expect("plans");
    let form = |op: &Op| if let Op::Conv2d(conv) = op { Some(conv.form) } else { None };
    plan.graph.nodes().iter().filter_map(|node| form(&node.op)).collect()
}

#[test]
fn winograd_is_chosen_by_shape_device_and_weights() {
    let software = Caps { tier: Tier::Software, ..Caps::baseline() };
    assert_eq!(forms(&software, WeightType::F32), [WeightForm::Winograd, WeightForm::Conv]);
    assert_eq!(forms(&software, WeightType::F16), [WeightForm::Conv, WeightForm::Conv]);
    assert_eq!(forms(&Caps::baseline(), WeightType::F32), [WeightForm::Conv, WeightForm::Conv]);
}

#[test]
fn both_algorithms_give_the_same_map() {
    let maps = tiers().into_iter().map(|gpu| run(&gpu, &graph(), &PlanOptions::default())).collect::<Vec<_>>();
    for map in &maps[1..] {
        assert_close("by tier", map, &maps[0], 4e-6);
    }
}

#[test]
fn a_plan_names_each_kernel_once_in_the_order_of_use() {
    let kernels = |caps: &Caps| {
        let plan = Plan::new(&graph(), caps, &PlanOptions::default()).expect("plans");
        let kernels = plan.kernels().expect("records");
        kernels.iter().map(|d| format!("{}/{}", d.shader.kernel, d.shader.variant)).collect::<Vec<_>>()
    };
    let winograd = ["winograd/input", "winograd/product", "winograd/output", "conv2d/software"];
    assert_eq!(kernels(&Caps { tier: Tier::Software, ..Caps::baseline() }), winograd);
    // Both convolutions by one kernel.
    assert_eq!(kernels(&Caps::baseline()), ["conv2d/baseline"]);
}

#[test]
fn pipelines_made_ahead_by_several_threads_are_the_ones_that_run() {
    let gpu = tiers().pop().expect("a tier");
    let plan = Plan::new(&graph(), &gpu.caps, &PlanOptions::default()).expect("plans");
    let kernels = plan.kernels().expect("records");
    std::thread::scope(|scope| {
        for _ in 0..3 {
            scope.spawn(|| kernels.iter().for_each(|d| gpu.prepare(d).expect("is made")));
        }
    });
    let whole = run(&gpu, &graph(), &PlanOptions::default());
    assert_close("with pipelines made ahead", &whole, &run(&tiers()[0], &graph(), &PlanOptions::default()), 4e-6);
}
