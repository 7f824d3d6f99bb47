//! What does not count leaves no trace: NaN under masks, too few entries, errors of zero; the displacement term; wrong shapes.

use omnix_graph::Value;
use omnix_tests::{Rng, assert_close, gpu, tiers};
use omnix_train::TrainError;
use omnix_train::loss::{
    Cameras, Depths, Displacements, LossConfig, Norm, Rays, Scored, Scores, TermWeights, Terms, Tracks,
};

use crate::support::{Case, assert_number, number};

const IMAGES: usize = 2;
const ROWS: usize = 28;
const COLUMNS: usize = 42;
const PIXELS: usize = ROWS * COLUMNS;

/// Random values of every term. Where a mask is 0, predictions, confidences and targets are `hidden`.
struct Everything {
    case: Case,
    terms: Terms,
    /// Predictions, with the mask of each and how many numbers an entry of the mask has.
    leaves: Vec<(Value, &'static str, usize)>,
}

fn everything(hidden: f32) -> Everything {
    let mut rng = Rng::new(23);
    let mut case = Case::default();
    let mut leaves = Vec::new();
    let mask = |case: &mut Case, rng: &mut Rng, name: &str, shape: &[usize]| {
        let data = (0..shape.iter().product()).map(|_| f32::from(u8::from(rng.uniform() < 0.9))).collect();
        case.input(name, shape, data)
    };
    // Numbers where the mask, each entry of which stands for `per` of them, is not 0.
    let under = |case: &mut Case, name: &str, shape: &[usize], (mask, per): (&str, usize), data: Vec<f32>| {
        let mask = case.data(mask).to_vec();
        let data = data.iter().enumerate().map(|(i, v)| if mask[i / per] == 0.0 { hidden } else { *v }).collect();
        case.input(name, shape, data)
    };
    let confident = |rng: &mut Rng, n: usize| rng.normal(n).iter().map(|v| 1.0 + v.exp()).collect::<Vec<_>>();
    let maps = [IMAGES, ROWS, COLUMNS];
    let full = [IMAGES, ROWS, COLUMNS, 6];
    let (n, n6) = (IMAGES * PIXELS, IMAGES * PIXELS * 6);

    let valid = mask(&mut case, &mut rng, "depth.valid", &maps);
    let by = ("depth.valid", 1);
    let depths = Depths {
        prediction: under(&mut case, "depth", &maps, by, rng.normal(n)),
        confidence: under(&mut case, "depth.confidence", &maps, by, confident(&mut rng, n)),
        target: under(&mut case, "depth.target", &maps, by, rng.normal(n)),
        valid,
    };
    leaves.extend([(depths.prediction, by.0, 1), (depths.confidence, by.0, 1)]);

    let valid = mask(&mut case, &mut rng, "ray.valid", &maps);
    let by = ("ray.valid", 6);
    let rays = Rays {
        prediction: under(&mut case, "ray", &full, by, rng.normal(n6)),
        confidence: under(&mut case, "ray.confidence", &maps, ("ray.valid", 1), confident(&mut rng, n)),
        target: under(&mut case, "ray.target", &full, by, rng.normal(n6)),
        valid,
    };
    leaves.extend([(rays.prediction, by.0, 6), (rays.confidence, by.0, 1)]);

    let (points, all) = ([IMAGES, IMAGES, PIXELS, 3], IMAGES * IMAGES * PIXELS);
    let valid = mask(&mut case, &mut rng, "tracks.valid", &points[..3]);
    let counted = mask(&mut case, &mut rng, "counted", &points[..3]);
    let by = ("tracks.valid", 3);
    let tracks = Tracks {
        prediction: under(&mut case, "tracks", &points, by, rng.normal(all * 3)),
        confidence: case.input("tracks.confidence", &[IMAGES, PIXELS], confident(&mut rng, n)),
        target: under(&mut case, "tracks.target", &points, by, rng.normal(all * 3)),
        valid,
        counted: Some(counted),
    };
    leaves.push((tracks.prediction, by.0, 3));

    let own = [1, 0];
    let moving = mask(&mut case, &mut rng, "moving", &points[..3]);
    // Where a point is unknown at its own time, its displacement is never known.
    let known = case.data("moving").to_vec();
    let at_own = |i: usize| (i / PIXELS / IMAGES * IMAGES + own[i / PIXELS / IMAGES]) * PIXELS + i % PIXELS;
    case.set("moving", (0..all).map(|i| known[i] * known[at_own(i)]).collect());
    let by = ("moving", 3);
    let displacement = Displacements {
        prediction: under(&mut case, "ungated", &points, by, rng.normal(all * 3)),
        target: under(&mut case, "ungated.target", &points, by, rng.normal(all * 3)),
        valid: moving,
        own: own.to_vec(),
    };

    let valid = mask(&mut case, &mut rng, "camera.valid", &[IMAGES, 9]);
    let by = ("camera.valid", 1);
    let camera = Cameras {
        prediction: under(&mut case, "camera", &[IMAGES, 9], by, rng.normal(IMAGES * 9)),
        target: under(&mut case, "camera.target", &[IMAGES, 9], by, rng.normal(IMAGES * 9)),
        valid,
        first_image: None,
    };
    leaves.push((camera.prediction, by.0, 1));

    let mut scored = |name: &'static str, shape: &[usize]| {
        let n = shape.iter().product();
        let mut names = [".label", ".labelled"].map(|leaf| format!("{name}{leaf}"));
        let labelled = mask(&mut case, &mut rng, &names[1], shape);
        let by = (std::mem::take(&mut names[1]), 1);
        let probability = under(&mut case, name, shape, (&by.0, 1), (0..n).map(|_| rng.uniform()).collect());
        let label = (0..n).map(|_| f32::from(u8::from(rng.uniform() < 0.3))).collect();
        Scored { probability, label: under(&mut case, &names[0], shape, (&by.0, 1), label), labelled }
    };
    let score = Scores { pixels: scored("theta", &maps), tokens: scored("token", &[IMAGES, 6]) };
    leaves.extend([
        (score.pixels.probability, "theta.labelled", 1),
        (score.tokens.probability, "token.labelled", 1),
        (displacement.prediction, "moving", 3),
    ]);
    let terms = Terms {
        depth: Some(depths),
        rays: Some(rays),
        camera: Some(camera),
        tracks: Some(tracks),
        displacement: Some(displacement),
        score: Some(score),
    };
    Everything { case, terms, leaves }
}

fn both_presets() -> [LossConfig; 2] {
    let weights = TermWeights::default().displacement(1.0);
    [LossConfig::release(), LossConfig::paper()].map(|preset| preset.weights(weights))
}

#[test]
fn nan_in_every_masked_entry_changes_no_bit_of_losses_and_gradients() {
    for config in both_presets() {
        let read = |hidden: f32, device: &omnix_kernels::Gpu| {
            let Everything { mut case, terms, leaves } = everything(hidden);
            let losses = terms.record(&mut case.graph, &config).expect("records");
            case.differentiate(losses.total, &leaves.iter().map(|(leaf, ..)| *leaf).collect::<Vec<_>>());
            let ready = case.run(device);
            let values: Vec<Vec<f32>> = losses.names.iter().map(|name| ready.read(name).expect("reads")).collect();
            let mut gradients = Vec::new();
            for (leaf, mask, per) in leaves {
                let name = case.graph.value_name(leaf).to_owned();
                let gradient = ready.read(&format!("gradient.{name}")).expect("reads");
                let mask = case.data(mask);
                let hidden = gradient.iter().enumerate().filter(|(i, _)| mask[i / per] == 0.0);
                assert!(hidden.clone().count() > 0, "{name}: something is masked");
                assert!(hidden.clone().all(|(_, v)| *v == 0.0), "{name}: a masked entry has a gradient");
                assert!(gradient.iter().any(|v| *v != 0.0), "{name}: there is a gradient");
                gradients.push(gradient);
            }
            (losses.names, values, gradients)
        };
        for device in tiers() {
            let (names, values, gradients) = read(0.25, &device);
            for (name, value) in names.iter().zip(&values) {
                assert!(value[0].is_finite() && value[0] != 0.0, "{name}: {value:?}");
            }
            assert!(gradients.iter().flatten().all(|v| v.is_finite()), "gradients are finite");
            let bits = |all: &[Vec<f32>]| all.iter().flatten().map(|v| v.to_bits()).collect::<Vec<_>>();
            let (_, hidden_values, hidden_gradients) = read(f32::NAN, &device);
            for (name, (with, without)) in names.iter().zip(hidden_values.iter().zip(&values)) {
                assert_eq!(with, without, "{name}, {}", device.caps.tier);
            }
            assert!(bits(&hidden_gradients) == bits(&gradients), "gradients, {}", device.caps.tier);
        }
    }
}

#[test]
fn a_term_with_fewer_than_a_hundred_valid_entries_is_zero() {
    for config in both_presets() {
        let Everything { mut case, terms, leaves } = everything(f32::NAN);
        let losses = terms.record(&mut case.graph, &config).expect("records");
        case.differentiate(losses.total, &leaves.iter().map(|(leaf, ..)| *leaf).collect::<Vec<_>>());
        let masks = ["depth.valid", "ray.valid", "tracks.valid", "moving", "theta.labelled"];
        // All masks lose entries until `left` remain.
        let cut = |case: &mut Case, left: f32| {
            for name in masks {
                let mut seen = 0.0;
                let data = case.data(name).iter().map(|v| {
                    seen += v;
                    if seen <= left { *v } else { 0.0 }
                });
                let data = data.collect();
                case.set(name, data);
            }
        };
        let terms = ["depth", "ray", "trajectory", "displacement", "score"];
        cut(&mut case, 100.0);
        let ready = case.run(gpu());
        for term in terms {
            assert_number(&ready, &format!("loss.{term}.entries"), 100.0, 0.0);
            assert!(number(&ready, &format!("loss.{term}")) > 0.0, "{term} with a hundred");
        }
        cut(&mut case, 99.0);
        let ready = case.run(gpu());
        let camera = number(&ready, "loss.camera");
        for name in &losses.names {
            let got = number(&ready, name);
            match name.as_str() {
                entries if terms.iter().any(|t| *entries == format!("loss.{t}.entries")) => {
                    assert_eq!(got, 99.0, "{name}")
                }
                "loss.total" => assert_eq!(got, camera, "the camera alone is left"),
                name if name.starts_with("loss.camera") => assert!(got > 0.0, "{name}"),
                _ => assert_eq!(got, 0.0, "{name}"),
            }
        }
        for (leaf, ..) in leaves {
            let name = format!("gradient.{}", case.graph.value_name(leaf));
            let still = ready.read(&name).expect("reads").iter().all(|v| *v == 0.0);
            assert_eq!(still, name != "gradient.camera", "{name}");
        }
    }
}

#[test]
fn nan_or_infinity_in_a_valid_entry_is_seen_in_the_loss() {
    for config in both_presets() {
        for bad in [f32::NAN, f32::INFINITY] {
            for (name, mask, per, losses) in [
                ("depth", "depth.valid", 1, "loss.depth"),
                ("ray.target", "ray.valid", 6, "loss.ray"),
                ("tracks", "counted", 3, "loss.trajectory"),
                ("ungated", "moving", 3, "loss.displacement"),
                ("camera", "camera.valid", 1, "loss.camera"),
                ("theta", "theta.labelled", 1, "loss.score"),
                ("token", "token.labelled", 1, "loss.score"),
            ] {
                let Everything { mut case, terms, .. } = everything(f32::NAN);
                let mut data = case.data(name).to_vec();
                let counts = |i: &usize| case.data(mask)[i / per] != 0.0 && data[*i].is_finite();
                let at = (0..data.len()).find(counts).expect("an entry that counts");
                data[at] = bad;
                case.set(name, data);
                terms.record(&mut case.graph, &config).expect("records");
                let ready = case.run(gpu());
                for output in [losses, "loss.total"] {
                    let got = number(&ready, output);
                    assert!(!got.is_finite(), "{bad} in {name}: {output} is {got}");
                }
            }
        }
    }
}

#[test]
fn a_first_image_with_a_hundred_valid_pixels_leaves_the_camera_out() {
    let run = |valid: usize| {
        let mut case = Case::default();
        let first = (0..PIXELS).map(|i| f32::from(u8::from(i < valid))).collect();
        let cameras = Cameras {
            prediction: case.input("camera", &[IMAGES, 9], vec![0.5; IMAGES * 9]),
            target: case.input("target", &[IMAGES, 9], vec![0.0; IMAGES * 9]),
            valid: case.input("valid", &[IMAGES, 9], vec![1.0; IMAGES * 9]),
            first_image: Some(case.input("first", &[ROWS, COLUMNS], first)),
        };
        let terms = Terms { camera: Some(cameras), ..Terms::default() };
        terms.record(&mut case.graph, &LossConfig::release()).expect("records");
        number(&case.run(gpu()), "loss.camera")
    };
    assert_eq!(run(100), 0.0);
    assert_eq!(run(101), 1.25);
}

#[test]
fn errors_of_zero_have_a_gradient_of_zero() {
    for norm in [Norm::L1, Norm::L2] {
        let mut case = Case::default();
        let shape = [1, 2, PIXELS, 3];
        let data = Rng::new(3).normal(2 * PIXELS * 3);
        let prediction = case.input("tracks", &shape, data.clone());
        let tracks = Tracks {
            prediction,
            confidence: case.input("confidence", &[1, PIXELS], vec![2.0; PIXELS]),
            target: case.input("target", &shape, data),
            valid: case.input("valid", &shape[..3], vec![1.0; 2 * PIXELS]),
            counted: None,
        };
        let terms = Terms { tracks: Some(tracks), ..Terms::default() };
        let losses = terms.record(&mut case.graph, &LossConfig::paper().track_norm(norm)).expect("records");
        case.differentiate(losses.total, &[prediction]);
        let ready = case.run(gpu());
        assert_number(&ready, "loss.trajectory.conf", -0.2 * f64::from(2.0f32).ln(), 1e-6);
        assert_eq!(number(&ready, "loss.trajectory.reg"), 0.0);
        assert!(ready.read("gradient.tracks").expect("reads").iter().all(|v| *v == 0.0), "{norm:?}");
    }
}

#[test]
fn displacements_are_those_from_the_own_time() {
    let (images, times) = (2, 3);
    let own = [2usize, 0];
    let n = images * times * PIXELS;
    let mut rng = Rng::new(9);
    let (prediction, target) = (rng.normal(n * 3), rng.normal(n * 3));
    let valid: Vec<f32> = (0..n).map(|_| f32::from(u8::from(rng.uniform() < 0.2))).collect();
    let shape = [images, times, PIXELS, 3];
    let mut case = Case::default();
    let leaf = case.input("ungated", &shape, prediction.clone());
    let displacement = Displacements {
        prediction: leaf,
        target: case.input("target", &shape, target.clone()),
        valid: case.input("valid", &shape[..3], valid.clone()),
        own: own.to_vec(),
    };
    let terms = Terms { displacement: Some(displacement), ..Terms::default() };
    let config = LossConfig::paper().track_norm(Norm::L2).weights(TermWeights::default().displacement(1.0));
    let losses = terms.record(&mut case.graph, &config).expect("records");
    case.differentiate(losses.total, &[leaf]);
    let ready = case.run(gpu());

    // |d| over the valid ones; d / |d| comes back, and its opposite to the point of the own time.
    let count = f64::from(valid.iter().sum::<f32>());
    let (mut sum, mut gradient) = (0.0f64, vec![0.0f64; n * 3]);
    for entry in (0..n).filter(|entry| valid[*entry] != 0.0) {
        let (image, pixel) = (entry / PIXELS / times, entry % PIXELS);
        let at_own = (image * times + own[image]) * PIXELS + pixel;
        let part = |data: &[f32], i: usize| f64::from(data[entry * 3 + i]) - f64::from(data[at_own * 3 + i]);
        let off: [f64; 3] = std::array::from_fn(|i| part(&prediction, i) - part(&target, i));
        let length = off.iter().map(|v| v * v).sum::<f64>().sqrt();
        sum += length;
        // At the own time both are nothing.
        for (i, off) in off.iter().enumerate().filter(|_| entry != at_own) {
            gradient[entry * 3 + i] += off / length / count;
            gradient[at_own * 3 + i] -= off / length / count;
        }
    }
    assert_number(&ready, "loss.displacement", sum / count, 1e-6);
    let want: Vec<f32> = gradient.into_iter().map(|v| v as f32).collect();
    assert_close("gradient", &ready.read("gradient.ungated").expect("reads"), &want, 1e-5);
}

#[test]
fn terms_that_do_not_fit_are_named() {
    let mut case = Case::default();
    let map = |case: &mut Case, name: &str, rows: usize| case.input(name, &[1, rows, COLUMNS], Vec::new());
    let depths = Depths {
        prediction: map(&mut case, "depth", ROWS),
        confidence: map(&mut case, "confidence", ROWS),
        target: map(&mut case, "truth", ROWS - 1),
        valid: map(&mut case, "valid", ROWS),
    };
    let terms = Terms { depth: Some(depths), ..Terms::default() };
    let error = terms.record(&mut case.graph, &LossConfig::release()).unwrap_err().to_string();
    assert_eq!(error, "loss.depth: `truth` has shape [1, 27, 42], expected [1, 28, 42]");
    let error = Terms::default().record(&mut case.graph, &LossConfig::release()).unwrap_err();
    assert!(matches!(error, TrainError::NoTerms), "{error}");
    let error = terms.record(&mut case.graph, &LossConfig::release().slope_scales(9)).unwrap_err().to_string();
    assert!(error.contains("slope_scales is 9"), "{error}");

    let points = case.input("points", &[1, 2, PIXELS, 3], Vec::new());
    let valid = case.input("moving", &[1, 2, PIXELS], Vec::new());
    let displacement = Displacements { prediction: points, target: points, valid, own: vec![2] };
    let terms = Terms { displacement: Some(displacement), ..Terms::default() };
    let error = terms.record(&mut case.graph, &LossConfig::release()).unwrap_err().to_string();
    assert!(error.contains("own times [2]") && error.contains("below 2"), "{error}");
}
