//! What is recorded against recordings of the reference networks, by the interpreter: the graph as recorded and fused.
//!
//! `tests/data/model/nano.safetensors` holds a few tensors of a run of the checkpoint inside the repository; the full goldens
//! are in `../shared` and compared when they are there.

use std::path::Path;

use omnix_geometry::{Camera, Pose, encode_pose_code};
use omnix_graph::Graph;
use omnix_graph::passes::fuse::fuse;
use omnix_model::{BackboneSpec, HeadSpec, Network, NetworkConfig, ReferenceChoice};
use omnix_tests::interpret;
use omnix_weights::{Checkpoint, TensorFile};

use crate::fixture;

/// Largest difference over the largest magnitude; float32 noise of the goldens is 1e-6 to 5e-6.
const BOUND: f32 = 5e-5;

struct Case {
    network: Network,
    checkpoint: Checkpoint,
    tensors: TensorFile,
    images: usize,
    grid: (usize, usize),
}

impl Case {
    /// `images` is the name of the normalised input.
    fn open(weights: &Path, case: &Path, images: &str) -> Self {
        let checkpoint = Checkpoint::open(weights).unwrap();
        let network = Network::new(NetworkConfig::from_json(checkpoint.config_json()).unwrap());
        let tensors = TensorFile::open(case).unwrap();
        let shape = tensors.tensor(images).unwrap().shape.to_vec();
        let [s, 3, h, w] = shape[shape.len() - 4..] else { panic!("{shape:?}") };
        Self { network, checkpoint, tensors, images: s, grid: (h / 14, w / 14) }
    }

    fn has(&self, name: &str) -> bool {
        self.tensors.info(name).is_some()
    }

    fn f32(&self, name: &str) -> Vec<f32> {
        self.tensors.tensor(name).unwrap().to_f32()
    }

    fn integers(&self, name: &str) -> Vec<i64> {
        let bytes = self.tensors.tensor_bytes(name).unwrap();
        bytes.as_chunks().0.iter().map(|b| i64::from_le_bytes(*b)).collect()
    }

    fn parameter(&self, name: &str) -> Vec<f32> {
        self.checkpoint.tensor(name).unwrap().to_f32()
    }

    /// Frame 0 of a planar map of all frames, channels last.
    fn first_map(&self, name: &str) -> Vec<f32> {
        let view = self.tensors.tensor(name).unwrap();
        let [_, c, h, w] = view.shape[..] else { panic!("{name}: {:?}", view.shape) };
        let all = view.to_f32();
        (0..h * w).flat_map(|pixel| (0..c).map(move |k| (k, pixel))).map(|(k, pixel)| all[k * h * w + pixel]).collect()
    }
}

/// Asserts that the largest difference is small against the largest magnitude.
fn close(what: &str, got: &[f32], expected: &[f32]) {
    assert_eq!(got.len(), expected.len(), "{what}");
    let size = expected.iter().fold(0.0f32, |m, v| m.max(v.abs()));
    let worst = got.iter().zip(expected).fold(0.0f32, |m, (a, b)| m.max((a - b).abs()));
    assert!(worst <= BOUND * size, "{what}: {worst} of {size}");
}

/// Names in `case` that begin like this, as recorded and as our graphs call them.
fn tapped(case: &Case, starts: &[&str]) -> Vec<(String, String)> {
    let names = case.tensors.tensors().map(|(name, _)| name.to_owned());
    let ours = |name: &str| match name {
        "backbone.block0" => "tok.block0".to_owned(),
        "out.pose_encoding" => "cam.pose_enc".to_owned(),
        _ => name.replace(".camera", ".cam"),
    };
    names.filter(|n| starts.iter().any(|s| n.starts_with(s))).map(|n| (ours(&n), n)).collect()
}

/// Compares every recorded value of the backbone.
fn backbone(case: &Case, images: &str, spec: &BackboneSpec, codes: Option<&[f32]>) {
    let taps = tapped(case, &["tok.", "feat.", "cam.", "backbone.", "out.pose_encoding", "out.aux."]);
    assert!(!taps.is_empty());
    let mut recorded = Graph::with_taps(taps.iter().map(|(ours, _)| ours.clone()));
    case.network.backbone(&mut recorded, spec).unwrap();
    let mut plain = Graph::new();
    case.network.backbone(&mut plain, spec).unwrap();
    let pixels = case.f32(images);
    let mut inputs = vec![("images", pixels.as_slice())];
    inputs.extend(codes.map(|c| ("camera_codes", c)));
    // Taps keep fusion away, so the fused graph without them is another run.
    for (graph, all) in [(recorded, true), (fuse(&plain), false)] {
        let run = interpret::run(&graph, &inputs, &|name| case.parameter(name));
        let mut compared = 0;
        for (ours, theirs) in &taps {
            let output = graph.outputs().iter().find(|v| graph.value_name(**v) == ours);
            if let Some(value) = output {
                close(ours, &run.rounded(*value), &case.f32(theirs));
                compared += 1;
            } else {
                assert!(!all, "{ours} is not recorded");
            }
        }
        assert!(compared >= 1, "nothing compared");
        if case.has("ref.index")
            && let Some(index) = run.find("ref.index")
        {
            assert_eq!(i64::from(index[0].to_bits()), case.integers("ref.index")[0]);
        }
    }
}

/// Compares every recorded map of the head, for frame 0 and the recorded features.
fn head(case: &Case) {
    let wide = case.network.config().backbone.feature_width();
    let patches = case.grid.0 * case.grid.1;
    let features: Vec<(String, Vec<f32>)> =
        (0..4).map(|k| (format!("feat.{k}"), case.f32(&format!("feat.{k}"))[..patches * wide].to_vec())).collect();
    let inputs: Vec<(&str, &[f32])> = features.iter().map(|(n, f)| (n.as_str(), f.as_slice())).collect();
    let maps =
        tapped(case, &["head.proj", "head.resized", "head.rn", "head.fuse", "head.neck", "head.main", "head.aux"]);
    // The OmniX goldens' `head.` tensors are another head's.
    let maps = if case.has("head.merged0") { Vec::new() } else { maps };
    let dual = case.network.config().makes_cameras();
    let spec = HeadSpec { frames: 1, grid: case.grid, rays: dual, points: false, gaussians: false };
    let mut recorded = Graph::with_taps(maps.iter().map(|(ours, _)| ours.clone()));
    case.network.head(&mut recorded, &spec).unwrap();
    let mut plain = Graph::new();
    case.network.head(&mut plain, &spec).unwrap();
    for (graph, all) in [(recorded, true), (fuse(&plain), false)] {
        let run = interpret::run(&graph, &inputs, &|name| case.parameter(name));
        for (ours, theirs) in maps.iter().filter(|_| all) {
            close(ours, &run.find(ours).unwrap_or_else(|| panic!("{ours} is not recorded")), &case.first_map(theirs));
        }
        // Sky is filled afterwards, over all frames.
        let single = [("depth", ["headout.depth", "out.depth"]), ("sky", ["out.sky", "out.sky"])];
        let outputs = [
            ("depth", ["out.depth", "out.depth"]),
            ("depth_conf", ["out.depth_conf", "out.depth_conf"]),
            ("ray", ["headout.ray", "out.ray"]),
            ("ray_conf", ["headout.ray_conf", "out.ray_conf"]),
        ];
        for (ours, theirs) in if dual { &outputs[..] } else { &single[..] } {
            let got = run.find(ours).unwrap();
            let Some(theirs) = theirs.iter().find(|t| case.has(t)) else { panic!("no {ours}") };
            close(ours, &got, &case.f32(theirs)[..got.len()]);
        }
    }
}

fn spec(case: &Case, reference: ReferenceChoice) -> BackboneSpec {
    let times = if case.has("in.video") {
        let (videos, frames) = (case.integers("in.video"), case.integers("in.frame"));
        videos.into_iter().zip(frames).map(|(v, f)| (v as u32, f as u32)).collect()
    } else {
        Vec::new()
    };
    BackboneSpec {
        images: case.images,
        grid: case.grid,
        reference,
        cameras_given: false,
        times,
        export_layers: Vec::new(),
    }
}

fn da3(network: &str, case: &str) -> Case {
    let folder = fixture::shared("golden/da3").expect("the recorded cases").join(network);
    Case::open(&folder, &folder.join(format!("{case}.safetensors")), "in.images")
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn depth_anything_with_every_intermediate() {
    for network in ["tiny-a", "tiny-b", "tiny-mono"] {
        let case = da3(network, "case");
        backbone(&case, "in.images", &spec(&case, case.network.default_reference()), None);
        head(&case);
    }
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn depth_anything_with_each_reference() {
    for (name, reference) in [
        ("case-single", ReferenceChoice::SaddleBalanced),
        ("case-pair", ReferenceChoice::SaddleBalanced),
        ("case-ref-first", ReferenceChoice::First),
        ("case-ref-middle", ReferenceChoice::Middle),
    ] {
        let case = da3("tiny-a", name);
        backbone(&case, "in.images", &spec(&case, reference), None);
    }
    let case = da3("tiny-a", "case-ref-saddle_sim_range");
    let index = case.integers("ref.index")[0] as usize;
    backbone(&case, "in.images", &spec(&case, ReferenceChoice::Forced(index)), None);
    let case = da3("tiny-b", "case-nine");
    backbone(&case, "in.images", &spec(&case, ReferenceChoice::SaddleBalanced), None);
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn depth_anything_with_exported_features() {
    let case = da3("tiny-a", "case-feats");
    let exported = tapped(&case, &["out.aux.feat_layer_"]);
    let layers = exported.iter().map(|(n, _)| n.rsplit('_').next().unwrap().parse().unwrap()).collect();
    let spec = BackboneSpec { export_layers: layers, ..spec(&case, ReferenceChoice::SaddleBalanced) };
    backbone(&case, "in.images", &spec, None);
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn depth_anything_with_given_cameras() {
    for network in ["tiny-a", "tiny-b"] {
        let case = da3(network, "case-posed");
        let (extrinsics, intrinsics) = (case.f32("in.extrinsics"), case.f32("in.intrinsics"));
        // They were given to the network as they are, without the tool's normalisation.
        let rows = |m: &[f32]| -> Pose { std::array::from_fn(|r| std::array::from_fn(|c| m[r * 4 + c])) };
        let poses: Vec<Pose> = extrinsics.chunks_exact(16).map(rows).collect();
        let (h, w) = ((case.grid.0 * 14) as u32, (case.grid.1 * 14) as u32);
        let codes: Vec<f32> = poses
            .iter()
            .zip(intrinsics.chunks_exact(9))
            .flat_map(|(extrinsics, k)| {
                let intrinsics = std::array::from_fn(|r| std::array::from_fn(|c| k[r * 3 + c]));
                encode_pose_code(&Camera { extrinsics: *extrinsics, intrinsics }, h, w)
            })
            .collect();
        let spec = BackboneSpec { cameras_given: true, ..spec(&case, ReferenceChoice::SaddleBalanced) };
        backbone(&case, "in.images", &spec, Some(&codes));
    }
}

#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn omnix_encoder_and_geometry() {
    let goldens = fixture::shared("golden/omnix").expect("the recorded cases");
    for name in ["mixed", "single-video", "one-image"] {
        let weights = if name == "one-image" { "single-video" } else { name };
        let file = goldens.join(name).join("case.safetensors");
        let case = Case::open(&goldens.join(weights), &file, "in.image_normalised");
        backbone(&case, "in.image_normalised", &spec(&case, ReferenceChoice::First), None);
        head(&case);
    }
}

/// The network that the program embedded first, from pictures to depth, rays and cameras.
#[test]
#[cfg_attr(not(shared), ignore = "../shared is not there")]
fn the_first_nano_from_pictures_to_depth() {
    let weights = fixture::root().join("../shared/weights/nano");
    let file = fixture::root().join("tests/data/model/nano.safetensors");
    let case = Case::open(&weights, &file, "in.image_normalised");
    let pixels = case.f32("in.image_normalised");

    let mut g = Graph::new();
    let outputs = case.network.backbone(&mut g, &spec(&case, ReferenceChoice::First)).unwrap();
    let g = fuse(&g);
    let run = interpret::run(&g, &[("images", &pixels)], &|name| case.parameter(name));
    close("cam.pose_enc", &run.rounded(outputs.pose_codes.unwrap()), &case.f32("out.pose_encoding"));
    let first: Vec<(String, Vec<f32>)> = (0..4)
        .map(|k| {
            let all = run.rounded(outputs.features[k]);
            (format!("feat.{k}"), all[..all.len() / case.images].to_vec())
        })
        .collect();
    close("feat.3", &first[3].1, &case.f32("feat.3"));

    let mut g = Graph::new();
    let spec = HeadSpec { frames: 1, grid: case.grid, rays: true, points: false, gaussians: false };
    let head = case.network.head(&mut g, &spec).unwrap();
    let inputs: Vec<(&str, &[f32])> = first.iter().map(|(name, data)| (name.as_str(), data.as_slice())).collect();
    let g = fuse(&g);
    let run = interpret::run(&g, &inputs, &|name| case.parameter(name));
    let (ray, ray_confidence) = head.rays.unwrap();
    for (name, value) in
        [("depth", head.depth), ("depth_conf", head.confidence.unwrap()), ("ray", ray), ("ray_conf", ray_confidence)]
    {
        close(name, &run.rounded(value), &case.f32(&format!("out.{name}")));
    }
}
