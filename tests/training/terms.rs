//! Single terms against published code: sums, means, gradients, slopes, cameras, labels, cross-entropy, the quantile.

use omnix_graph::Value;
use omnix_tests::{assert_close, gpu};
use omnix_train::loss::{
    CameraError, Cameras, Depths, LossConfig, Norm, Rays, Scored, Scores, Terms, Tracks, Trim, labels,
};

use crate::support::{Case, Recorded, assert_number, number};

/// Means over valid entries, nothing left out; the depth term without slopes.
fn plain() -> LossConfig {
    LossConfig::paper().slope_weight(0.0)
}

/// A regression term of recorded values, its two leaves for gradients, and its name.
fn regression(recorded: &Recorded, kind: &str) -> (Case, Terms, [Value; 2], &'static str) {
    let mut case = Case::default();
    let shape = recorded.shape(&format!("{kind}.confidence"));
    let [images, rows, columns] = [shape[0] * shape[1], shape[2], shape[3]];
    let (maps, points) = ([images, rows, columns], [images, 1, rows * columns, 3]);
    let mut input = |leaf: &str, shape: &[usize]| case.input(leaf, shape, recorded.get(&format!("{kind}.{leaf}")));
    let mut terms = Terms::default();
    let (leaves, name) = match kind {
        "depth" => {
            let (prediction, confidence) = (input("pred", &maps), input("confidence", &maps));
            let (target, valid) = (input("gt", &maps), input("valid", &maps));
            terms.depth = Some(Depths { prediction, confidence, target, valid });
            ([prediction, confidence], "loss.depth")
        }
        "ray" => {
            let full = [images, rows, columns, 6];
            let (prediction, confidence) = (input("pred", &full), input("confidence", &maps));
            let (target, valid) = (input("gt", &full), input("valid", &maps));
            terms.rays = Some(Rays { prediction, confidence, target, valid });
            ([prediction, confidence], "loss.ray")
        }
        _ => {
            let (prediction, confidence) = (input("pred", &points), input("confidence", &[images, rows * columns]));
            let (target, valid) = (input("gt", &points), input("valid", &points[..3]));
            terms.tracks = Some(Tracks { prediction, confidence, target, valid, counted: None });
            ([prediction, confidence], "loss.trajectory")
        }
    };
    (case, terms, leaves, name)
}

#[test]
fn regression_terms_and_their_gradients() {
    let recorded = Recorded::open("terms");
    for (kind, norm) in [("depth", "l1"), ("ray", "l1"), ("trajectory", "l1"), ("trajectory", "l2")] {
        let (mut case, terms, leaves, name) = regression(&recorded, kind);
        let config = plain().track_norm(if norm == "l2" { Norm::L2 } else { Norm::L1 });
        let losses = terms.record(&mut case.graph, &config).expect("records");
        case.differentiate(losses.total, &leaves);
        let ready = case.run(gpu());
        let expected = |leaf: &str| recorded.number(&format!("{kind}/expected/{norm}/{leaf}"));
        let valid = recorded.number(&format!("{kind}/valid"));
        assert_number(&ready, name, expected("total_mean_over_valid"), 1e-6);
        assert_number(&ready, &format!("{name}.conf"), expected("weighted_minus_log_sum") / valid, 1e-6);
        assert_number(&ready, &format!("{name}.reg"), expected("plain_sum") / valid, 1e-6);
        assert_number(&ready, &format!("{name}.entries"), valid, 0.0);
        for (leaf, recorded_as) in [("pred", "grad_pred"), ("confidence", "grad_confidence")] {
            let want = recorded.get(&format!("{kind}.{recorded_as}_{norm}_mean_over_valid"));
            let got = ready.read(&format!("gradient.{leaf}")).expect("reads");
            assert_close(&format!("{kind} {norm} {leaf}"), &got, &want, 1e-6);
        }

        let (mut case, terms, ..) = regression(&recorded, kind);
        let all = config.divide_by(omnix_train::loss::DivideBy::AllEntries);
        terms.record(&mut case.graph, &all).expect("records");
        assert_number(&case.run(gpu()), name, expected("total_mean_over_all_pixels"), 1e-6);
    }
}

#[test]
fn slopes_at_one_scale_and_at_four() {
    let recorded = Recorded::open("terms");
    let slope = |scales: u32, valid: Vec<f32>| {
        let mut case = Case::default();
        let maps = [2, 24, 28];
        let depths = Depths {
            prediction: case.input("pred", &maps, recorded.get("gradient.pred")),
            confidence: case.input("confidence", &maps, vec![1.0; valid.len()]),
            target: case.input("gt", &maps, recorded.get("gradient.gt")),
            valid: case.input("valid", &maps, valid),
        };
        let terms = Terms { depth: Some(depths), ..Terms::default() };
        terms.record(&mut case.graph, &LossConfig::release().slope_scales(scales)).expect("records");
        case.run(gpu())
    };
    let valid = recorded.get("gradient.valid");
    let everywhere = vec![1.0; valid.len()];
    let want = |leaf: &str| recorded.number(&format!("gradient/{leaf}"));
    assert_number(&slope(1, valid.clone()), "loss.depth.slope", want("single_scale"), 1e-6);
    assert_number(&slope(4, valid), "loss.depth.slope", want("four_scales_mean"), 1e-6);
    assert_number(&slope(1, everywhere), "loss.depth.slope", want("single_scale_all_valid"), 1e-6);
}

#[test]
fn cameras_by_l1_and_huber() {
    let recorded = Recorded::open("terms");
    let run = |camera: CameraError| {
        let mut case = Case::default();
        let shape = recorded.shape("camera.pred_t3_q4_f2");
        let cameras = Cameras {
            prediction: case.input("pred", &shape, recorded.get("camera.pred_t3_q4_f2")),
            target: case.input("gt", &shape, recorded.get("camera.gt_t3_q4_f2")),
            valid: case.input("valid", &shape, vec![1.0; shape.iter().product()]),
            first_image: None,
        };
        let terms = Terms { camera: Some(cameras), ..Terms::default() };
        terms.record(&mut case.graph, &LossConfig::release().camera(camera)).expect("records");
        case.run(gpu())
    };
    let cases = [
        (CameraError::L1, "l1_means"),
        (CameraError::Huber { delta: 0.1 }, "huber_delta_0.1"),
        (CameraError::Huber { delta: 1.0 }, "huber_delta_1.0"),
    ];
    for (camera, name) in cases {
        let ready = run(camera);
        for (ours, theirs) in [("translation", "translation"), ("rotation", "quaternion"), ("fov", "fov")] {
            let want = recorded.number(&format!("camera/{name}/{theirs}"));
            assert_number(&ready, &format!("loss.camera.{ours}"), want, 1e-5);
        }
    }
    assert_number(&run(CameraError::L1), "loss.camera", recorded.number("camera/l1_weighted_1_1_0.5"), 1e-6);
}

/// The score term over pixels and tokens.
fn scores(pixels: [(&[usize], Vec<f32>); 3], tokens: [(&[usize], Vec<f32>); 3]) -> Case {
    let mut case = Case::default();
    let mut scored = |of: &str, [probability, label, labelled]: [(&[usize], Vec<f32>); 3]| Scored {
        probability: case.input(&format!("{of}.probability"), probability.0, probability.1),
        label: case.input(&format!("{of}.label"), label.0, label.1),
        labelled: case.input(&format!("{of}.labelled"), labelled.0, labelled.1),
    };
    let score = Scores { pixels: scored("pixels", pixels), tokens: scored("tokens", tokens) };
    let terms = Terms { score: Some(score), ..Terms::default() };
    terms.record(&mut case.graph, &LossConfig::release().least_entries(1)).expect("records");
    case
}

#[test]
fn motion_labels_and_their_cross_entropy() {
    let recorded = Recorded::open("terms");
    let (rows, columns, patch, times) = (28, 35, 7, 4);
    let paths = recorded.get("dynamic.trajectory");
    let [mut pixels, mut tokens] = [const { (Vec::new(), Vec::new()) }; 2];
    for image in paths.chunks_exact(times * rows * columns * 3) {
        let found = labels::of_pixels(image, rows * columns, None).expect("labels");
        let pooled = labels::of_tokens(&found, [rows, columns], patch).expect("labels");
        for (all, labels) in [(&mut pixels, found), (&mut tokens, pooled)] {
            all.0.extend(labels.label);
            all.1.extend(labels.labelled);
        }
    }
    let expected = |leaf: &str| recorded.number(&format!("dynamic/expected/{leaf}"));
    let mean = |data: &[f32]| data.iter().map(|v| f64::from(*v)).sum::<f64>() / data.len() as f64;
    assert!((mean(&pixels.1) - expected("valid_supervision_ratio")).abs() < 1e-6, "{}", mean(&pixels.1));
    let moving = mean(&pixels.0) / mean(&pixels.1);
    assert!((moving - expected("dynamic_ratio")).abs() < 1e-6, "{moving}");

    let (maps, cells) = ([2, rows, columns], [2, 20]);
    let ready = scores(
        [(&maps, recorded.get("dynamic.pixel_score")), (&maps, pixels.0), (&maps, pixels.1)],
        [(&cells, recorded.get("dynamic.token_score")), (&cells, tokens.0), (&cells, tokens.1)],
    )
    .run(gpu());
    assert_number(&ready, "loss.score", expected("loss_dynamic_score"), 1e-5);
    assert_number(&ready, "loss.score.pixel", expected("loss_pts3d_dynamic_score"), 1e-5);
    assert_number(&ready, "loss.score.token", expected("loss_token_dynamic_score"), 1e-5);
}

#[test]
fn cross_entropy_of_certain_scores_is_finite() {
    let recorded = Recorded::open("terms");
    let shape: &[usize] = &[40];
    let data = || [recorded.get("bce.prob"), recorded.get("bce.target"), vec![1.0; 40]].map(|data| (shape, data));
    let certain = data()[0].1.iter().filter(|p| **p == 0.0 || **p == 1.0).count();
    assert!(certain > 1, "the case has scores of 0 and 1");
    let mut case = scores(data(), data());
    let (total, leaves) = {
        let find = |name: &str| case.graph.find(name).expect("a value");
        (find("loss.total"), [find("pixels.probability"), find("tokens.probability")])
    };
    case.differentiate(total, &leaves);
    let ready = case.run(gpu());
    // Pixels are clamped, tokens only by the floor of the logarithm.
    assert_number(&ready, "loss.score.pixel", recorded.number("bce/mean_prob_clamped_1e-6"), 1e-5);
    assert_number(&ready, "loss.score.token", recorded.number("bce/mean_log_clamped_at_minus_100"), 1e-5);
    for name in ["gradient.pixels.probability", "gradient.tokens.probability"] {
        assert!(ready.read(name).expect("reads").iter().all(|v| v.is_finite()), "{name}");
    }
}

#[test]
fn what_is_not_below_the_quantile_is_left_out() {
    let recorded = Recorded::open("terms");
    let run = |trim: Trim| {
        let mut case = Case::default();
        let maps = [1, 50, 60];
        let depths = Depths {
            prediction: case.input("pred", &maps, recorded.get("quantile.values")),
            confidence: case.input("confidence", &maps, vec![1.0; 3000]),
            target: case.input("gt", &maps, vec![0.0; 3000]),
            valid: case.input("valid", &maps, vec![1.0; 3000]),
        };
        let terms = Terms { depth: Some(depths), ..Terms::default() };
        terms.record(&mut case.graph, &LossConfig::release().trim(trim)).expect("records");
        number(&case.run(gpu()), "loss.depth.reg")
    };
    let quantile = |above: u32| Trim::Quantile { keep: recorded.number("quantile/quantile"), above, largest: 100.0 };
    let kept = recorded.number("quantile/kept_sum") / 3000.0;
    let all = recorded.get("quantile.values").iter().map(|v| f64::from(*v)).sum::<f64>() / 3000.0;
    // 2,939 remain.
    assert_eq!(recorded.number("quantile/kept"), 2939.0);
    for (trim, want) in [(quantile(1000), kept), (quantile(2938), kept), (quantile(2939), all), (Trim::None, all)] {
        let got = run(trim);
        assert!((got - want).abs() <= 1e-6 * want, "{trim:?}: {got}, want {want}");
    }
}
