//! Parameters that become inputs, and the gradients of whole tensors that an optimiser reads.

use std::collections::BTreeMap;

use omnix_graph::graph::WeightForm;
use omnix_graph::ops::{Binary, HeadNorm, Heads, Op, Unary};
use omnix_graph::passes::adopt::{gradient_output, parameter_input};
use omnix_graph::{Graph, GraphError, Plan, PlanOptions, Shape, Value};
use omnix_kernels::{Gpu, Tier, WeightType};
use omnix_tests::{Trial, assert_close, family, gpu, tiers, trials};

use crate::case::Case;

pub(crate) fn trials() -> Vec<Trial> {
    trials!(
        "adopt",
        tiers: [
            inputs_give_the_bits_of_the_store,
            f16_copies_give_the_bits_of_a_store_of_f16,
            large_convolutions_go_by_winograds_algorithm,
        ],
        device: [
            some_tensors_may_stay_in_the_store,
            each_gradient_is_the_same_without_the_others,
            chunks_and_budgets_change_no_bit,
        ],
        once: [
            gradients_are_whole_tensors_in_the_order_of_names,
            one_gradient_of_two_tensors_is_two_outputs,
            gradients_that_no_node_makes_are_outputs,
            names_that_the_graph_does_not_read_change_nothing,
        ],
    )
}

/// A network with every form in which parameters are read; its outputs.
fn network() -> (Case, Vec<Value>) {
    let mut case = Case::new("network");
    let c = 16;
    // Pixels to tokens.
    let pixels = case.leaf("pixels", [2, 6, 6, 3]);
    let (kernel, bias) = (case.parameter("patch.weight", [c, 3, 3, 3]), case.parameter("patch.bias", [c]));
    let map = case.graph.conv2d(pixels, kernel, Some(bias), 2, 1).expect("patches");
    let tokens = case.graph.reshape(map, [2 * 9, c]).expect("tokens");
    // A row of numbers added under another shape than it has in the checkpoint.
    let position = case.parameter("position", [1, 9, c]);
    let row = case.graph.reshape(position, [9, c]).expect("rows");
    let tokens = case.graph.reshape(tokens, [2, 9, c]).expect("images");
    let tokens = case.graph.add_values(tokens, row).expect("positions");
    let tokens = case.graph.reshape(tokens, [18, c]).expect("tokens");
    // Attention by blocks of rows of one matrix, with norms of heads.
    let (weight, bias) = (case.parameter("norm.weight", [c]), case.parameter("norm.bias", [c]));
    let x = case.graph.layer_norm(tokens, Some(weight), Some(bias), 1e-6).expect("norm");
    case.tensor("qkv", &Shape::from([3 * c, c]));
    let heads = |norm| Heads { groups: 2, heads: 2, head_dim: c / 2, norm, rope: None };
    let norm =
        HeadNorm { weight: case.parameter("q.weight", [c / 2]), bias: case.parameter("q.bias", [c / 2]), eps: 1e-6 };
    let part = |case: &mut Case, rows: std::ops::Range<usize>| {
        let w = case.graph.parameter_rows("qkv", [3 * c, c], rows);
        case.graph.linear(x, w, None).expect("columns")
    };
    let (q, kv) = (part(&mut case, 0..c), part(&mut case, c..3 * c));
    let q = case.graph.query_heads(q, 0, &heads(Some(norm))).expect("queries");
    let k = case.graph.key_heads(kv, 0, &heads(Some(norm))).expect("keys");
    let v = case.graph.value_heads(kv, c, &heads(None)).expect("values");
    let y = case.graph.attention(q, k, v).expect("attention");
    // Blocks of columns over two inputs.
    case.tensor("merge", &Shape::from([c, 2 * c]));
    let left = case.graph.parameter_columns("merge", [c, 2 * c], 0..c);
    let right = case.graph.parameter_columns("merge", [c, 2 * c], c..2 * c);
    let (a, b) =
        (case.graph.linear(y, left, None).expect("left"), case.graph.linear(tokens, right, None).expect("right"));
    let y = case.graph.add_values(a, b).expect("merge");
    let y = case.graph.map(Unary::Gelu, y);
    let scale = case.parameter("scale", [c]);
    let y = case.graph.zip(Binary::Mul, y, scale).expect("scale");
    // And back to a larger map.
    let map = case.graph.reshape(y, [2, 3, 3, c]).expect("map");
    let (kernel, bias) = (case.parameter("up.weight", [c, 5, 2, 2]), case.parameter("up.bias", [5]));
    let up = case.graph.conv_transpose2d(map, kernel, Some(bias)).expect("up");
    let last = case.parameter("last", [2, 5, 3, 3]);
    let out = case.graph.conv2d(up, last, None, 1, 1).expect("last");
    (case, vec![out, y])
}

/// All gradients of `graph` on the device, by tensor.
fn read(case: &Case, gpu: &Gpu, graph: &Graph, names: &[String]) -> BTreeMap<String, Vec<f32>> {
    let executable = case.run(gpu, graph);
    let one = |name: &String| (name.clone(), executable.read(&gradient_output(name)).expect("reads"));
    names.iter().map(one).collect()
}

fn inputs_give_the_bits_of_the_store(gpu: &Gpu) {
    let (mut case, outputs) = network();
    let loss = case.loss(&outputs);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    let stored = read(&case, gpu, &graph, &names);
    let adopted = graph.adopt(&names, WeightType::F32).expect("adopts");
    for name in &names {
        let input = adopted.find(&parameter_input(name)).expect("an input");
        assert_eq!(adopted.shape(input).elements(), case.data[name].len(), "{name}");
    }
    assert_eq!(read(&case, gpu, &adopted, &names), stored, "{}", family(gpu));
    // And they are the gradients.
    case.check(gpu, &outputs);
}

/// Products read rounded copies, and nothing else does.
fn f16_copies_give_the_bits_of_a_store_of_f16(gpu: &Gpu) {
    let (mut case, outputs) = network();
    let loss = case.loss(&outputs);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    let full = read(&case, gpu, &graph, &names);
    case.options = case.options.storage(WeightType::F16);
    let stored = read(&case, gpu, &graph, &names);
    let adopted = graph.adopt(&names, WeightType::F16).expect("adopts");
    assert_eq!(read(&case, gpu, &adopted, &names), stored, "{}", family(gpu));
    // Rounding to 11 bits is seen, and is all that is seen.
    let apart = |name: &String| omnix_tests::relative_error(&stored[name], &full[name]);
    let largest = names.iter().map(apart).fold(0.0, f64::max);
    assert!((1e-6..2e-2).contains(&largest), "{largest} ({})", family(gpu));
    assert!(matches!(graph.adopt(&names, WeightType::I8), Err(GraphError::Arguments { op: "pack", .. })));
}

/// Where that pays, forward and for the gradient of the input, with weights that a node or the host transforms. Weights that a small map reads
/// too are packed once, for the sum over taps.
fn large_convolutions_go_by_winograds_algorithm(gpu: &Gpu) {
    let mut case = Case::new("large convolutions");
    let (x, small) = (case.leaf("x", [1, 44, 45, 64]), case.leaf("small", [1, 4, 5, 64]));
    let names = ["first", "second", "shared"];
    let [first, second, shared] = names.map(|name| case.parameter(name, [64, 64, 3, 3]));
    let mut y = x;
    for w in [first, second, shared] {
        let z = case.graph.map(Unary::Gelu, y);
        let z = case.graph.conv2d(z, w, None, 1, 1).expect("records");
        y = case.graph.add_values(z, y).expect("adds");
    }
    let other = case.graph.conv2d(small, shared, None, 1, 1).expect("records");
    // Gradients that need what the last ones compute.
    let squares = [y, other].map(|y| case.graph.map(Unary::Square, y));
    let loss = case.loss(&squares);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|name| name != "second").expect("differentiates");
    let adopted = graph.adopt(&names, WeightType::F32).expect("adopts");
    let plan = Plan::new(&adopted, &gpu.caps, &PlanOptions::default()).expect("plans");
    let form = |op: &Op| if let Op::Conv2d(conv) = op { Some(conv.form) } else { None };
    let forms: Vec<WeightForm> = plan.graph.nodes().iter().filter_map(|node| form(&node.op)).collect();
    use WeightForm::{Conv, ConvGradient, Winograd, WinogradGradient};
    let want = match gpu.caps.tier {
        Tier::Software => [Winograd, Winograd, Conv, Conv, WinogradGradient, WinogradGradient],
        _ => [Conv, Conv, Conv, Conv, ConvGradient, ConvGradient],
    };
    assert_eq!(forms, want, "{}", family(gpu));
    let by_tiles = |op: &Op| if let Op::Conv2dWeights(op) = op { Some(op.winograd) } else { None };
    let gradients: Vec<bool> = plan.graph.nodes().iter().filter_map(|node| by_tiles(&node.op)).collect();
    let software = gpu.caps.tier == Tier::Software;
    assert_eq!(gradients.iter().filter(|winograd| **winograd).count(), if software { 2 } else { 0 }, "{}", family(gpu));
    let baseline = read(&case, &tiers()[0], &adopted, &names);
    for (graph, what) in [(&adopted, "packed by a node"), (&graph, "packed by the host")] {
        for (name, gradient) in read(&case, gpu, graph, &names) {
            assert_close(&format!("{name}, {what}, {}", family(gpu)), &gradient, &baseline[&name], 1e-5);
        }
    }
}

fn some_tensors_may_stay_in_the_store(gpu: &Gpu) {
    let (mut case, outputs) = network();
    let loss = case.loss(&outputs);
    let mut whole = case.graph.clone();
    let all = whole.gradients(loss, &|_| true).expect("differentiates");
    let want = read(&case, gpu, &whole, &all);
    let mut graph = case.graph.clone();
    let some = graph.gradients(loss, &|name| name != "qkv" && !name.starts_with("up.")).expect("differentiates");
    assert_eq!(some.len(), all.len() - 3);
    let graph = graph.adopt(&some, WeightType::F32).expect("adopts");
    assert!(graph.find(&parameter_input("qkv")).is_none(), "a frozen tensor is no input");
    for (name, gradient) in read(&case, gpu, &graph, &some) {
        assert_eq!(gradient, want[&name], "{name} ({})", family(gpu));
    }
}

/// What is frozen changes nothing of what is trained.
fn each_gradient_is_the_same_without_the_others(gpu: &Gpu) {
    let (mut case, outputs) = network();
    let loss = case.loss(&outputs);
    let gradient = |wanted: &dyn Fn(&str) -> bool| {
        let mut graph = case.graph.clone();
        let names = graph.gradients(loss, wanted).expect("differentiates");
        (read(&case, gpu, &graph, &names), graph.nodes().len())
    };
    let (all, nodes) = gradient(&|_| true);
    for name in all.keys() {
        let (one, fewer) = gradient(&|wanted| wanted == name);
        assert_eq!(one.len(), 1);
        assert_eq!(one[name], all[name], "{name} ({})", family(gpu));
        assert!(fewer < nodes, "{name} alone is recorded with {fewer} nodes, all with {nodes}");
    }
}

fn chunks_and_budgets_change_no_bit(gpu: &Gpu) {
    let (mut case, outputs) = network();
    let loss = case.loss(&outputs);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    let want = read(&case, gpu, &graph, &names);
    case.options = case.options.parts(3);
    assert_eq!(read(&case, gpu, &graph, &names), want, "in chunks ({})", family(gpu));
    let too_little = Plan::new(&graph, &gpu.caps, &PlanOptions::default().budget(1)).expect_err("a byte");
    let GraphError::Budget { least, .. } = too_little else { panic!("{too_little}") };
    case.options = PlanOptions::default().budget(least);
    assert_eq!(read(&case, gpu, &graph, &names), want, "in {least} bytes ({})", family(gpu));
}

fn gradients_are_whole_tensors_in_the_order_of_names() {
    let (mut case, outputs) = network();
    let loss = case.loss(&outputs);
    let mut graph = case.graph.clone();
    let names = graph.gradients(loss, &|_| true).expect("differentiates");
    let want: Vec<&String> = case.data.keys().filter(|name| *name != "pixels").collect();
    assert_eq!(names.iter().collect::<Vec<_>>(), want);
    for name in &names {
        let gradient = graph.find(&gradient_output(name)).expect("an output");
        assert!(graph.outputs().contains(&gradient), "{name} is an output");
        assert_eq!(graph.shape(gradient).elements(), case.data[name].len(), "{name}");
    }
}

/// Two tensors that are added have one gradient; each output has memory of its own.
fn one_gradient_of_two_tensors_is_two_outputs() {
    let mut case = Case::new("one gradient");
    let x = case.leaf("x", [3, 4]);
    let (a, b) = (case.parameter("a", [3, 4]), case.parameter("b", [3, 4]));
    let y = case.graph.add_values(x, a).expect("adds");
    let y = case.graph.add_values(y, b).expect("adds");
    let z = case.graph.map(Unary::Square, y);
    case.check(gpu(), &[z]);
}

/// The gradient is the constant 1, or what the host writes.
fn gradients_that_no_node_makes_are_outputs() {
    let mut case = Case::new("a constant");
    let bias = case.parameter("bias", [1]);
    let mut graph = case.graph.clone();
    let names = graph.gradients(bias, &|_| true).expect("differentiates");
    assert_eq!(read(&case, gpu(), &graph, &names)["bias"], [1.0]);
    let adopted = graph.adopt(&names, WeightType::F32).expect("adopts");
    assert_eq!(read(&case, gpu(), &adopted, &names)["bias"], [1.0]);

    let mut case = Case::new("an input");
    let (x, p) = (case.given("x", [1], vec![2.5]), case.parameter("p", [1]));
    let y = case.graph.zip(Binary::Mul, p, x).expect("records");
    let mut graph = case.graph.clone();
    let names = graph.gradients(y, &|_| true).expect("differentiates");
    assert_eq!(read(&case, gpu(), &graph, &names)["p"], [2.5]);
}

fn names_that_the_graph_does_not_read_change_nothing() {
    let (case, _) = network();
    let adopted = case.graph.adopt(&["no such tensor".to_owned()], WeightType::F32).expect("adopts");
    assert_eq!(adopted.nodes().len(), case.graph.nodes().len());
    assert_eq!(adopted.count(), case.graph.count());
}
