//! What is recorded: shapes, parameters, what fusion leaves, which nodes run in chunks, requests that cannot be met.

use std::collections::BTreeMap;

use omnix_graph::graph::Source;
use omnix_graph::ops::{Binary, Map, Op, Resize, Unary, Zip};
use omnix_graph::passes::fuse::fuse;
use omnix_graph::plan::schedule::segments;
use omnix_graph::{Graph, GraphError, Value};
use omnix_model::{
    BackboneOutputs, BackboneSpec, HeadSpec, ModelError, Network, NetworkConfig, Parts, Reference, ReferenceChoice,
    manifest,
};
use omnix_weights::Requirement;

use crate::fixture;

fn spec(images: usize, grid: (usize, usize)) -> BackboneSpec {
    BackboneSpec {
        images,
        grid,
        reference: ReferenceChoice::First,
        cameras_given: false,
        times: (0..images as u32).map(|i| (0, i)).collect(),
        export_layers: Vec::new(),
    }
}

fn backbone(network: &Network, spec: &BackboneSpec) -> (Graph, BackboneOutputs) {
    let mut g = Graph::new();
    let outputs = network.backbone(&mut g, spec).unwrap();
    (g, outputs)
}

fn dims(g: &Graph, value: Value) -> Vec<usize> {
    g.shape(value).to_vec()
}

fn declared(g: &Graph) -> Vec<&str> {
    g.outputs().iter().map(|v| g.value_name(*v)).collect()
}

#[test]
fn outputs_have_their_shapes() {
    for (name, c) in [("tiny-a", 64), ("tiny-b", 128), ("mixed", 48), ("single-video", 64)] {
        let network = fixture::network(name);
        for (images, grid) in [(1, (1, 1)), (2, (5, 7)), (3, (3, 4)), (4, (37, 37)), (1, (20, 36))] {
            let (p, hw) = (grid.0 * grid.1, [14 * grid.0, 14 * grid.1]);
            let (g, outputs) = backbone(&network, &spec(images, grid));
            assert_eq!(dims(&g, outputs.images), [images, 3, hw[0], hw[1]]);
            assert!(outputs.features.iter().all(|f| dims(&g, *f) == [images, p, 2 * c]), "{name} {grid:?}");
            assert_eq!(dims(&g, outputs.pose_codes.unwrap()), [images, 9]);
            assert_eq!(declared(&g), ["feat.0", "feat.1", "feat.2", "feat.3", "cam.pose_enc"]);

            let mut g = Graph::new();
            let head = network
                .head(&mut g, &HeadSpec { frames: images, grid, rays: true, points: false, gaussians: false })
                .unwrap();
            assert!(head.features.iter().all(|f| dims(&g, *f) == [images, p, 2 * c]));
            assert_eq!(dims(&g, head.depth), [images, hw[0], hw[1]]);
            assert_eq!(dims(&g, head.confidence.unwrap()), [images, hw[0], hw[1]]);
            let (ray, confidence) = head.rays.unwrap();
            assert_eq!(dims(&g, ray), [images, 8 * grid.0, 8 * grid.1, 6]);
            assert_eq!(dims(&g, confidence), [images, 8 * grid.0, 8 * grid.1]);
            assert_eq!(declared(&g), ["depth", "depth_conf", "ray", "ray_conf"]);
            // The coarsest level is half the grid, rounded up.
            let coarsest = g.find("head.rn4").unwrap();
            assert_eq!(dims(&g, coarsest)[1..3], [grid.0.div_ceil(2), grid.1.div_ceil(2)]);
        }
    }
}

/// Every parameter of `g`, with its whole shape.
fn parameters(g: &Graph) -> BTreeMap<String, Vec<usize>> {
    let all = g.values().filter_map(|(_, info)| match &info.source {
        Source::Parameter(p) => Some((p.name.to_string(), p.full.to_vec())),
        _ => None,
    });
    all.collect()
}

#[test]
fn parameters_are_those_of_the_manifest() {
    let published = [NetworkConfig::small(), NetworkConfig::giant()];
    for config in published.into_iter().chain(["tiny-a", "tiny-b", "mixed"].map(fixture::config)) {
        for (rays, given_cameras) in [(false, false), (true, config.camera_encoder.is_some())] {
            let network = Network::new(config.clone());
            let mut g = Graph::new();
            network.backbone(&mut g, &BackboneSpec { cameras_given: given_cameras, ..spec(3, (2, 3)) }).unwrap();
            network.head(&mut g, &HeadSpec { frames: 1, grid: (2, 3), rays, points: false, gaussians: false }).unwrap();
            let mut recorded = parameters(&g);
            let manifest = manifest(&config, &Parts { rays, given_cameras, ..Parts::default() });
            for expected in manifest.expected() {
                match recorded.remove(&expected.name) {
                    Some(shape) => assert_eq!(shape, expected.shape, "{}", expected.name),
                    // Learnt camera tokens are not used when cameras are given.
                    None if expected.name.ends_with(".camera_token") => assert!(given_cameras),
                    None => assert_eq!(expected.requirement, Requirement::Optional, "{} is not used", expected.name),
                }
            }
            assert!(recorded.is_empty(), "{} records what its manifest lacks: {recorded:?}", config.name);
        }
    }
}

#[test]
fn without_rays_nothing_of_their_branch_is_recorded() {
    let network = Network::new(NetworkConfig::small());
    let record = |rays| {
        let mut g = Graph::new();
        network.head(&mut g, &HeadSpec { frames: 1, grid: (20, 36), rays, points: false, gaussians: false }).unwrap();
        g
    };
    let (plain, with_rays) = (record(false), record(true));
    assert!(parameters(&plain).keys().all(|name| !name.contains("_aux")));
    assert!(plain.values().all(|(_, info)| !info.name.contains("aux")));
    let used = parameters(&with_rays);
    assert!(used.keys().any(|n| n.contains("output_conv1_aux.3.4")));
    let other_levels = ["_aux.0.0.", "_aux.1.", "_aux.2.", "_aux.0.5."];
    assert!(used.keys().all(|n| other_levels.iter().all(|level| !n.contains(level))));
}

/// Nodes of `g` that satisfy `which`.
fn count(g: &Graph, which: impl Fn(&Op) -> bool) -> usize {
    g.nodes().iter().filter(|n| which(&n.op)).count()
}

#[test]
fn fusion_leaves_no_pointwise_work_in_blocks() {
    let config = NetworkConfig::small();
    let network = Network::new(config.clone());
    let (g, _) = backbone(&network, &spec(2, (5, 7)));
    let fused = fuse(&g);
    let local = (0..12).filter(|i| !config.backbone.is_global(*i)).count();
    let global = 12 - local;
    assert_eq!((local, global), (8, 4));
    // A local block: 2 norms, qkv, proj, fc1, fc2. A global one: 4 norms, q, k, v, proj, fc1, fc2. Final norms: 4.
    assert_eq!(count(&fused, |op| matches!(op, Op::LayerNorm { .. })), 2 * local + 4 * global + 4);
    // Patch embedding and the camera decoder's 5.
    assert_eq!(count(&fused, |op| matches!(op, Op::Linear(_))), 4 * local + 6 * global + 1 + 5);
    assert_eq!(count(&fused, |op| matches!(op, Op::SplitHeads(_))), 3 * 12);
    assert_eq!(count(&fused, |op| matches!(op, Op::Attention(_))), 12);
    assert_eq!(count(&fused, |op| matches!(op, Op::Map(_))), 0);
    // The position rows alone.
    assert_eq!(count(&fused, |op| matches!(op, Op::Zip(_))), 1);
    assert_eq!(count(&fused, |op| matches!(op, Op::Gather { .. } | Op::ReferenceView { .. })), 0);

    // SwiGLU stays one node between its two products.
    let (g, _) = backbone(&fixture::network("tiny-b"), &spec(2, (5, 7)));
    let fused = fuse(&g);
    assert_eq!(count(&fused, |op| matches!(op, Op::SwiGlu { .. })), 8);
    assert_eq!(count(&fused, |op| matches!(op, Op::Map(_) | Op::Zip(_))), 1);
}

#[test]
fn fusion_leaves_little_pointwise_work_in_the_head() {
    let network = Network::new(NetworkConfig::small());
    let mut g = Graph::new();
    network.head(&mut g, &HeadSpec { frames: 2, grid: (5, 7), rays: true, points: false, gaussians: false }).unwrap();
    let fused = fuse(&g);
    assert_eq!(count(&fused, |op| matches!(op, Op::Map(Map { op: Unary::Relu, .. }))), 0);
    // Three exponentials' worth: depth, and two confidences with their + 1.
    assert_eq!(count(&fused, |op| matches!(op, Op::Map(_))), 2 + 3);
    // UV codes behind the four projections, on the ray branch's neck, and where the map takes the picture's size.
    assert_eq!(count(&fused, |op| matches!(op, Op::Zip(Zip { op: Binary::Add, .. }))), 0);
    assert_eq!(count(&fused, |op| matches!(op, Op::Resize(Resize { code: Some(_), .. }))), 4 + 1 + 1);
    assert_eq!(count(&fused, |op| matches!(op, Op::Resize { .. })), 4 + 4 + 4 + 1 + 1);
    // resize_layers.3, four rn, two chains of seven units of two, neck, 3x3, five plain ones and a 3x3.
    assert_eq!(count(&fused, |op| matches!(op, Op::Conv2d(_))), 1 + 4 + 2 * 14 + 2 + 6);
}

#[test]
fn blocks_run_in_chunks() {
    let config = NetworkConfig::small();
    let (g, _) = backbone(&Network::new(config), &spec(4, (20, 36)));
    let fused = fuse(&g);
    let mut chained = 0;
    for segment in segments(&fused, 0, 256, false) {
        for i in segment.nodes.clone() {
            let Op::Attention(attention) = &fused.nodes()[i].op else { continue };
            chained += 1;
            let chain =
                segment.chain.as_ref().unwrap_or_else(|| panic!("attention of {} groups runs whole", attention.groups));
            assert_eq!(chain.rows, 4 * 721);
            // Behind attention: proj, norm, fc1, fc2 go through in the same chunk, and what comes before makes queries.
            assert!(segment.nodes.end - i >= 5 && i - segment.nodes.start >= 3, "{:?} around {i}", segment.nodes);
            assert!(chain.interior.len() >= 5);
        }
    }
    assert_eq!(chained, 12);
}

#[test]
fn the_reference_is_first_known_or_selected() {
    let network = fixture::network("tiny-a");
    let with = |images, reference, cameras_given| {
        let (g, outputs) = backbone(&network, &BackboneSpec { reference, cameras_given, ..spec(images, (2, 3)) });
        let gathers = count(&g, |op| matches!(op, Op::Gather { .. }));
        (outputs.reference, gathers, g)
    };
    use ReferenceChoice::{First, Forced, Middle, SaddleBalanced, SaddleSimRange};
    for choice in [First, Middle, SaddleBalanced, SaddleSimRange, Forced(1)] {
        let (reference, gathers, _) = with(2, choice, false);
        assert_eq!((reference, gathers), (Reference::Known(0), 0), "two views have no choice: {choice:?}");
        let (reference, ..) = with(3, choice, true);
        assert_eq!(reference, Reference::Known(0), "given cameras keep the order: {choice:?}");
    }
    assert_eq!(with(5, Middle, false).0, Reference::Known(2));
    assert_eq!(with(5, Forced(4), false).0, Reference::Known(4));
    assert_eq!(with(5, First, false).0, Reference::Known(0));
    for choice in [SaddleBalanced, SaddleSimRange] {
        let (reference, gathers, g) = with(3, choice, false);
        let Reference::Selected(index) = reference else { panic!("{reference:?}") };
        assert_eq!((g.value_name(index), dims(&g, index)), ("ref.index", vec![1]));
        // The stream, then both halves of four features and four camera tokens back.
        assert_eq!(gathers, 13);
        assert_eq!(count(&fuse(&g), |op| matches!(op, Op::Gather { .. })), 10, "three camera tokens are not needed");
    }
}

#[test]
fn given_cameras_are_encoded_in_the_same_graph() {
    // Heads 4 wide (padded) and 8 wide.
    for (name, c) in [("tiny-a", 64), ("tiny-b", 128)] {
        let (g, outputs) = backbone(&fixture::network(name), &BackboneSpec { cameras_given: true, ..spec(3, (2, 3)) });
        assert_eq!(dims(&g, outputs.camera_codes.unwrap()), [3, 9]);
        assert_eq!(g.value_name(outputs.camera_codes.unwrap()), "camera_codes");
        assert_eq!(dims(&g, g.find("cam.token").unwrap()), [3, c]);
        assert!(!parameters(&g).contains_key("backbone.pretrained.camera_token"));
    }
    let (g, outputs) = backbone(&fixture::network("tiny-a"), &spec(3, (2, 3)));
    assert!(outputs.camera_codes.is_none() && g.find("camera_codes").is_none());
}

#[test]
fn exports_and_taps() {
    let network = fixture::network("tiny-a");
    let wanted = BackboneSpec { export_layers: vec![1, 4], ..spec(3, (2, 3)) };
    let (g, outputs) = backbone(&network, &wanted);
    let names: Vec<_> = outputs.exports.iter().map(|(i, v)| (*i, g.value_name(*v).to_owned(), dims(&g, *v))).collect();
    let expected = |i: usize| (i, format!("out.aux.feat_layer_{i}"), vec![3, 2, 3, 64]);
    assert_eq!(names, [expected(1), expected(4)]);

    let mut g = Graph::with_taps(["tok.block3".to_owned(), "feat.1.cam".to_owned()]);
    network.backbone(&mut g, &spec(3, (2, 3))).unwrap();
    let mut names = declared(&g);
    names.sort_unstable();
    assert_eq!(names, ["cam.pose_enc", "feat.0", "feat.1", "feat.1.cam", "feat.2", "feat.3", "tok.block3"]);
}

#[test]
fn requests_that_cannot_be_met() {
    let (da3, omnix) = (fixture::network("tiny-a"), fixture::network("mixed"));
    let message = |network: &Network, spec: &BackboneSpec| {
        let error = network.backbone(&mut Graph::new(), spec).unwrap_err();
        assert!(matches!(error, ModelError::Request { .. }), "{error}");
        error.to_string()
    };
    let base = || spec(3, (2, 3));
    let forced = BackboneSpec { reference: ReferenceChoice::Forced(3), ..base() };
    assert!(message(&da3, &forced).contains("there are views 0 to 2"));
    let layer = BackboneSpec { export_layers: vec![10], ..base() };
    assert!(message(&da3, &layer).contains("has blocks 0 to 9"));
    assert!(message(&da3, &spec(0, (2, 3))).contains("at least one"));
    assert!(message(&da3, &spec(1, (0, 3))).contains("at least one"));
    assert!(message(&da3, &spec(1, (usize::MAX, 3))).contains("14 to 57344 pixels"));
    let cameras = BackboneSpec { cameras_given: true, ..base() };
    assert!(message(&omnix, &cameras).contains("has no camera encoder"));
    let selected = BackboneSpec { reference: ReferenceChoice::SaddleBalanced, ..base() };
    assert!(message(&omnix, &selected).contains("takes the first image"));
    let times = BackboneSpec { times: vec![(0, 0)], ..base() };
    assert!(message(&omnix, &times).contains("a frame number for each of 3 images"));
    let head = da3
        .head(&mut Graph::new(), &HeadSpec { frames: 0, grid: (2, 3), rays: false, points: false, gaussians: false });
    assert!(matches!(head, Err(ModelError::Request { .. })));
    let mut config = fixture::config("tiny-a");
    config.head.features = 0;
    assert!(matches!(Network::new(config).backbone(&mut Graph::new(), &base()), Err(ModelError::BadField { .. })));
}

#[test]
fn assemble_checks_its_pieces() {
    use omnix_graph::ops::Piece;
    let mut g = Graph::new();
    let x = g.input("x", [2, 3]);
    let piece = |dims: [usize; 2], start, at: [usize; 2]| Piece {
        value: x,
        dims: dims.to_vec(),
        start,
        strides: vec![3, 1],
        at: at.to_vec(),
    };
    assert!(g.assemble([4, 3], &[piece([2, 3], 0, [0, 0]), piece([2, 3], 0, [2, 0])]).is_ok());
    let outside = g.assemble([2, 3], &[piece([2, 3], 1, [0, 0])]);
    assert!(matches!(outside, Err(GraphError::Shape { op: "assemble", .. })));
    let over = g.assemble([2, 3], &[piece([2, 3], 0, [1, 0])]);
    assert!(matches!(over, Err(GraphError::Shape { op: "assemble", .. })));
}
