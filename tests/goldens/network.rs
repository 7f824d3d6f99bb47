//! Networks on the device, every recorded intermediate that belongs to a part that exists.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use omnix::graph::{Executable, Graph};
use omnix::model::{BackboneSpec, HeadSpec, Network};
use omnix::{Camera, ReferenceChoice, WeightType, Weights};

use crate::case::{Case, Comparison, Tensor};
use crate::collect::Folder;
use crate::joined;
use crate::motion::{self, Before};
use crate::ready::{Report, prepare};

/// What is compared elsewhere or belongs to no part that exists: the trajectory module's ([`crate::motion`]), the Gaussian head's
/// ([`crate::gaussians`]).
const ELSEWHERE: &[&str] = &[
    "traj.",
    "tau",
    "moved",
    // Compared by [`crate::gaussians`].
    "headout.raw_gs",
    "out.gaussians",
    "out.pixel_score",
    "out.token_score",
    "out.trajectory",
    "out.points",
];

/// Runs all cases of `folder`.
pub(crate) fn run(folder: &Folder, limits: &[(WeightType, f64)], total: &mut Comparison) -> Result<(), String> {
    let cases = folder.cases();
    if cases.is_empty() {
        return Ok(());
    }
    let model = match folder.file("model.safetensors") {
        Some(_) => folder.path.clone(),
        // Cases without a network of their own share their neighbour's.
        None => folder.path.with_file_name("single-video"),
    };
    let weights = Weights::open(&model).map_err(|e| e.to_string())?;
    for path in cases {
        let stem = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
        let case = Case::open(&path)?;
        for (storage, limit) in limits {
            // Only f32 counts for the headline; the others for figures of their own.
            let headline = *storage == WeightType::F32;
            let label = match storage {
                WeightType::F32 => stem.clone(),
                WeightType::F16 => format!("{stem} f16"),
                WeightType::I8 => format!("{stem} i8"),
            };
            all(&weights, &case, &stem, *storage, &mut |name, got, want| {
                let limit = if !headline && motion::SAMPLED.contains(&name) { 2.0 * limit } else { *limit };
                total.compare(&format!("{label} {name}"), got, want, limit, headline);
            })
            .map_err(|e| format!("{label}: {e}"))?;
        }
    }
    Ok(())
}

/// The network of a case, or both of a nested one; and where results depend on all images, a whole run.
fn all(weights: &Weights, case: &Case, stem: &str, storage: WeightType, report: Report<'_>) -> Result<(), String> {
    let network = weights.network();
    match network.metric() {
        None => one(weights, network, case, stem, storage, report)?,
        Some(metric) => {
            for (part, network) in [("anyview.", network), ("metric.", &metric)] {
                let recorded = case.part(part);
                one(weights, network, &recorded, stem, storage, &mut |name, got, want| {
                    report(&format!("{part}{name}"), got, want);
                })?;
            }
        }
    }
    if network.config().makes_sky() { joined::run(weights, case, storage, report) } else { Ok(()) }
}

/// How the file says the reference view was chosen.
fn reference(network: &Network, case: &Case, stem: &str) -> ReferenceChoice {
    match (stem, case.number("ref.index")) {
        ("case-ref-first", _) => ReferenceChoice::First,
        ("case-ref-middle", _) => ReferenceChoice::Middle,
        // Two views tie by construction there.
        ("case-ref-saddle_sim_range", Some(index)) => ReferenceChoice::Forced(index as usize),
        _ => network.default_reference(),
    }
}

/// The name under which our graphs know a recorded tensor.
fn our_name(recorded: &str) -> String {
    match recorded {
        "backbone.block0" => "tok.block0".to_owned(),
        "out.pose_encoding" => "cam.pose_enc".to_owned(),
        "out.depth" | "out.depth_conf" | "out.ray" | "out.ray_conf" => recorded["out.".len()..].to_owned(),
        "headout.ray" | "headout.ray_conf" | "headout.depth" | "headout.depth_conf" | "headout.sky" => {
            recorded["headout.".len()..].to_owned()
        }
        "out.sky" => "sky".to_owned(),
        // One map, two branches.
        "head.sky.in" => "head.main.in".to_owned(),
        name => name.strip_suffix(".camera").map_or_else(|| name.to_owned(), |stem| format!("{stem}.cam")),
    }
}

fn one(
    weights: &Weights,
    network: &Network,
    case: &Case,
    stem: &str,
    storage: WeightType,
    report: Report<'_>,
) -> Result<(), String> {
    let (images, [count, height, width]) = case.images()?;
    let grid = (height / 14, width / 14);
    let wanted = expected(network, case);
    if wanted.is_empty() {
        return Ok(());
    }
    let taps: Vec<String> = wanted.keys().cloned().collect();
    let text = |e: &dyn std::fmt::Display| e.to_string();

    let times: Vec<_> = match (case.get("in.video"), case.get("in.frame")) {
        (Some(video), Some(frame)) => video.data.iter().zip(&frame.data).map(|(v, f)| (*v as u32, *f as u32)).collect(),
        _ => (0..count as u32).map(|i| (0, i)).collect(),
    };
    let cameras = cameras(case)?;
    let layers = wanted.keys().filter_map(|n| n.strip_prefix("out.aux.feat_layer_")?.parse().ok()).collect();
    let spec = BackboneSpec {
        images: count,
        grid,
        reference: reference(network, case, stem),
        cameras_given: cameras.is_some(),
        times: times.clone(),
        export_layers: layers,
    };
    let mut graph = Graph::with_taps(taps.clone());
    network.backbone(&mut graph, &spec).map_err(|e| text(&e))?;
    let backbone = prepare(weights, &graph, storage).map_err(|e| text(&e))?;
    backbone.write("images", &images.data).map_err(|e| text(&e))?;
    if let Some(cameras) = cameras {
        let codes: Vec<f32> =
            cameras.iter().flat_map(|c| omnix::geometry::encode_pose_code(c, height as u32, width as u32)).collect();
        backbone.write("camera_codes", &codes).map_err(|e| text(&e))?;
    }
    backbone.run(&mut |_, _| ControlFlow::Continue(())).map_err(|e| text(&e))?;

    let (moves, dual) = (network.config().trajectory.is_some(), network.config().makes_cameras());
    let gaussians = case.get("headout.raw_gs").is_some();
    let mut graph = Graph::with_taps(taps);
    let spec = HeadSpec { frames: count, grid, rays: dual, points: moves, gaussians };
    network.head(&mut graph, &spec).map_err(|e| text(&e))?;
    let head = prepare(weights, &graph, storage).map_err(|e| text(&e))?;
    for k in 0..4 {
        let name = format!("feat.{k}");
        let feature = backbone.read(&name).map_err(|e| text(&e))?;
        head.write(&name, &feature).map_err(|e| text(&e))?;
    }
    if gaussians {
        head.write("pictures", &images.data).map_err(|e| text(&e))?;
    }
    head.run(&mut |_, _| ControlFlow::Continue(())).map_err(|e| text(&e))?;
    if gaussians {
        crate::gaussians::compare(case, &head, [height, width], report)?;
    }
    compare(&wanted, &backbone, &head, count, report)?;
    if dual {
        decoded_cameras(case, &backbone, height, width, report)?;
    }
    motion::run(weights, case, storage, &Before { backbone: &backbone, head: &head, times, grid }, report)
}

/// Recorded tensors of parts that exist, by our name.
fn expected<'a>(network: &Network, case: &'a Case) -> BTreeMap<String, &'a Tensor> {
    // What becomes of the maps for all images together is a whole run's.
    let joined = |name: &str| network.config().makes_sky() && name == "out.depth";
    let elsewhere = |name: &str| ELSEWHERE.iter().any(|l| name.starts_with(l));
    let derived = |name: &str| matches!(name, "out.extrinsics" | "out.intrinsics" | "out.camera_to_world");
    // The head names of an OmniX case belong to its sampling head, which stands on other features.
    let sampling = |name: &str| name.starts_with("head.") && case.get("in.image_u8").is_some();
    let wanted =
        case.tensors.iter().filter(|(n, _)| !n.starts_with("in.") && !elsewhere(n) && !derived(n) && !sampling(n));
    let wanted = wanted.filter(|(n, _)| !joined(n));
    wanted.map(|(name, tensor)| (our_name(name), tensor)).collect()
}

/// Given cameras, exactly as the network gets them.
fn cameras(case: &Case) -> Result<Option<Vec<Camera>>, String> {
    let (Some(e), Some(k)) = (case.get("in.extrinsics"), case.get("in.intrinsics")) else { return Ok(None) };
    let extrinsics = e.data.chunks_exact(16).map(|m| std::array::from_fn(|r| std::array::from_fn(|c| m[4 * r + c])));
    let intrinsics = k.data.chunks_exact(9).map(|m| std::array::from_fn(|r| std::array::from_fn(|c| m[3 * r + c])));
    Ok(Some(extrinsics.zip(intrinsics).map(|(extrinsics, intrinsics)| Camera { extrinsics, intrinsics }).collect()))
}

fn compare(
    wanted: &BTreeMap<String, &Tensor>,
    backbone: &Executable,
    head: &Executable,
    images: usize,
    report: Report<'_>,
) -> Result<(), String> {
    let has = |name: &str| backbone.slice(name).is_ok() || head.slice(name).is_ok();
    // A reference that the caller fixes is not computed.
    for (name, tensor) in wanted.iter().filter(|(n, _)| *n != "ref.index" || has(n)) {
        let source = if backbone.slice(name).is_ok() && !name.starts_with("head") { backbone } else { head };
        let got = if name == "ref.index" {
            let index = source.read_indices(name).map_err(|e| format!("{name}: {e}"))?;
            index.iter().map(|i| *i as f32).collect()
        } else {
            source.read(name).map_err(|e| format!("{name}: {e}"))?
        };
        let want = if name.starts_with("head.") { tensor.channels_last() } else { tensor.data.clone() };
        // Some maps were recorded for the first image only.
        let first_only = name.starts_with("head.") && tensor.shape[0] == 1 && images > 1;
        let got = if first_only { &got[..got.len() / images] } else { &got[..] };
        report(name, got, &want);
    }
    Ok(())
}

/// The cameras that the host decodes from the pose code.
fn decoded_cameras(
    case: &Case,
    backbone: &Executable,
    height: usize,
    width: usize,
    report: Report<'_>,
) -> Result<(), String> {
    let codes = backbone.read("cam.pose_enc").map_err(|e| e.to_string())?;
    let cameras: Vec<Camera> = codes
        .as_chunks::<9>()
        .0
        .iter()
        .map(|c| omnix::geometry::decode_pose_code(*c, height as u32, width as u32))
        .collect();
    let extrinsics: Vec<f32> = cameras.iter().flat_map(|c| c.extrinsics.concat()).collect();
    let intrinsics: Vec<f32> = cameras.iter().flat_map(|c| c.intrinsics.concat()).collect();
    if let Some(want) = case.get("out.extrinsics") {
        report("out.extrinsics", &extrinsics, &want.data);
    }
    if let Some(want) = case.get("out.camera_to_world") {
        let c2w: Vec<f32> = cameras.iter().flat_map(|c| omnix::geometry::invert_pose(&c.extrinsics).concat()).collect();
        report("out.camera_to_world", &c2w, &want.data);
    }
    if let Some(want) = case.get("out.intrinsics") {
        report("out.intrinsics", &intrinsics, &want.data);
    }
    Ok(())
}
