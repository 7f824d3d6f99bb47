//! One recorded training step of the release: every loss from its predictions and targets, and the gradients of the total with
//! respect to depth, rays and points.
//!
//! The trajectories are made on the host from the recorded points and what was sampled for pixels above the gate; the others stand
//! still. Their gradient goes back to the points the same way.

use omnix_graph::Value;
use omnix_graph::ops::{Binary, Corners, Filter};
use omnix_tests::{assert_close, gpu, tiers};
use omnix_train::loss::{Cameras, Depths, LossConfig, Rays, Scored, Scores, Terms, Tracks, labels, still};

use crate::support::{Case, Recorded, assert_number};

const IMAGES: usize = 4;
const ROWS: usize = 70;
const COLUMNS: usize = 84;
const PIXELS: usize = ROWS * COLUMNS;
const RAYS: [usize; 2] = [40, 48];
const PATCH: usize = 14;
/// Below this norm a vector of the 6D code is not made longer.
const FLOOR: f64 = 1e-3;

type Matrix = [[f64; 3]; 3];

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn column(m: &Matrix, j: usize) -> [f64; 3] {
    m.map(|row| row[j])
}

/// The rotation of a 6D code, columns e1, e2, e3.
fn rotation(code: &[f64]) -> Matrix {
    let unit = |v: [f64; 3]| v.map(|x| x / dot(v, v).sqrt().max(FLOOR));
    let e1 = unit([code[0], code[1], code[2]]);
    let b = [code[3], code[4], code[5]];
    let along = dot(b, e1);
    let e2 = unit(std::array::from_fn(|i| b[i] - along * e1[i]));
    let e3 = [e1[1] * e2[2] - e1[2] * e2[1], e1[2] * e2[0] - e1[0] * e2[2], e1[0] * e2[1] - e1[1] * e2[0]];
    std::array::from_fn(|i| [e1[i], e2[i], e3[i]])
}

/// How a pixel above the gate moves to each time.
struct Moved {
    /// Over all images.
    pixel: usize,
    rotations: [Matrix; IMAGES],
    shifts: [[f64; 3]; IMAGES],
}

/// Relative to the image's own time, which is its index.
fn moved(recorded: &Recorded) -> Vec<Moved> {
    let tau = recorded.get("gated.tau");
    let read = |(at, pixel): (usize, &f32)| {
        let pixel = *pixel as usize;
        let codes: Vec<Vec<f64>> = (0..IMAGES)
            .map(|time| tau[(at * IMAGES + time) * 9..][..9].iter().map(|v| f64::from(*v)).collect())
            .collect();
        let own = &codes[pixel / PIXELS];
        let back = rotation(own);
        Moved {
            pixel,
            rotations: std::array::from_fn(|time| {
                let here = rotation(&codes[time]);
                std::array::from_fn(|i| std::array::from_fn(|j| dot(here[i], back[j])))
            }),
            shifts: std::array::from_fn(|time| std::array::from_fn(|i| codes[time][6 + i] - own[6 + i])),
        }
    };
    recorded.get("gated.pixel").iter().enumerate().map(read).collect()
}

/// Predicted trajectories `[image, time, pixel, 3]`.
fn predicted(recorded: &Recorded) -> Vec<f32> {
    let points = recorded.get("out.points");
    let mut paths = Vec::with_capacity(IMAGES * points.len());
    for image in points.chunks_exact(PIXELS * 3) {
        (0..IMAGES).for_each(|_| paths.extend_from_slice(image));
    }
    for Moved { pixel, rotations, shifts } in moved(recorded) {
        let point: [f64; 3] = std::array::from_fn(|i| f64::from(points[pixel * 3 + i]));
        for time in 0..IMAGES {
            let at = ((pixel / PIXELS * IMAGES + time) * PIXELS + pixel % PIXELS) * 3;
            for i in 0..3 {
                paths[at + i] = (dot(rotations[time][i], point) + shifts[time][i]) as f32;
            }
        }
    }
    paths
}

/// The gradient of the points from that of the trajectories.
fn back_to_points(recorded: &Recorded, gradient: &[f32]) -> Vec<f32> {
    let path = |image: usize, time: usize, pixel: usize| ((image * IMAGES + time) * PIXELS + pixel) * 3;
    let mut points = vec![0.0f64; IMAGES * PIXELS * 3];
    for (i, sum) in points.iter_mut().enumerate() {
        let (image, pixel) = (i / 3 / PIXELS, i / 3 % PIXELS);
        *sum = (0..IMAGES).map(|time| f64::from(gradient[path(image, time, pixel) + i % 3])).sum();
    }
    for Moved { pixel, rotations, .. } in moved(recorded) {
        for i in 0..3 {
            points[pixel * 3 + i] = (0..IMAGES)
                .map(|time| {
                    let at = path(pixel / PIXELS, time, pixel % PIXELS);
                    dot(column(&rotations[time], i), std::array::from_fn(|j| f64::from(gradient[at + j])))
                })
                .sum();
        }
    }
    points.into_iter().map(|v| v as f32).collect()
}

/// True trajectories `[image, time, pixel, 3]`, NaN where unknown, from their short form.
fn truth(recorded: &Recorded) -> Vec<f32> {
    let (own, moving, known) = (recorded.get("true.own"), recorded.get("true.moving"), recorded.get("true.known"));
    let mut paths = vec![0.0; IMAGES * own.len()];
    let mut listed = 0;
    for (pixel, moves) in recorded.get("in.moving").iter().enumerate() {
        for time in 0..IMAGES {
            let at = ((pixel / PIXELS * IMAGES + time) * PIXELS + pixel % PIXELS) * 3;
            for i in 0..3 {
                paths[at + i] = match () {
                    () if known[pixel] == 0.0 && time != pixel / PIXELS => f32::NAN,
                    () if *moves != 0.0 => moving[(listed * IMAGES + time) * 3 + i],
                    () => own[pixel * 3 + i],
                };
            }
        }
        listed += usize::from(*moves != 0.0);
    }
    assert_eq!(listed * IMAGES * 3, moving.len(), "all moving pixels are used");
    paths
}

/// Which entries of trajectories are known, `[image, time, pixel]`, and which belong to moving pixels.
fn entries(recorded: &Recorded, truth: &[f32]) -> (Vec<f32>, Vec<f32>) {
    let (valid, moving) = (recorded.get("in.valid"), recorded.get("in.moving"));
    let source = |i: usize| i / PIXELS / IMAGES * PIXELS + i % PIXELS;
    let known = |i: usize| truth[i * 3..][..3].iter().all(|v| v.is_finite()) && valid[source(i)] != 0.0;
    (0..truth.len() / 3).map(|i| (f32::from(u8::from(known(i))), moving[source(i)])).unzip()
}

/// What the graph is asked about.
struct Values {
    depth: Value,
    ray: Value,
    paths: Value,
}

/// The case's inputs, and the terms over them.
fn terms(recorded: &Recorded, sampled: bool) -> (Case, Terms, Values) {
    let mut case = Case::default();
    let maps = [IMAGES, ROWS, COLUMNS];
    let map = |case: &mut Case, name: &str| case.input(name, &maps, recorded.get(name));
    let depth = map(&mut case, "out.depth");
    let (confidence, target, valid) =
        (map(&mut case, "out.depth_conf"), map(&mut case, "in.depth"), map(&mut case, "in.valid"));
    let depths = Depths { prediction: depth, confidence, target, valid };

    let [h, w] = RAYS;
    let ray = case.input("out.ray", &[IMAGES, h, w, 6], recorded.get("out.ray"));
    let rays = Rays {
        prediction: ray,
        confidence: case.input("out.ray_conf", &[IMAGES, h, w], recorded.get("out.ray_conf")),
        target: case.input("gt.ray", &[IMAGES, h, w, 6], recorded.get("gt.ray")),
        valid: case.input("ray.valid", &[IMAGES, h, w], vec![1.0; IMAGES * h * w]),
    };

    let truth = truth(recorded);
    let (known, moving) = entries(recorded, &truth);
    let paths = case.input("paths", &[IMAGES, IMAGES, PIXELS, 3], predicted(recorded));
    let counted = sampled.then(|| {
        let drawn = still::drawn(&moving, &known, still::SHARE, &mut |_, _| true).expect("draws");
        case.input("counted", &[IMAGES, IMAGES, PIXELS], drawn)
    });
    let tracks = Tracks {
        prediction: paths,
        confidence: case.input("out.trajectory_conf", &[IMAGES, PIXELS], recorded.get("out.trajectory_conf")),
        target: case.input("truth", &[IMAGES, IMAGES, PIXELS, 3], truth),
        valid: case.input("known", &[IMAGES, IMAGES, PIXELS], known),
        counted,
    };

    let cameras = Cameras {
        prediction: case.input("out.pose_encoding", &[IMAGES, 9], recorded.get("out.pose_encoding")),
        target: case.input("gt.pose_encoding", &[IMAGES, 9], recorded.get("gt.pose_encoding")),
        valid: case.input("camera.valid", &[IMAGES, 9], vec![1.0; IMAGES * 9]),
        first_image: Some(case.input("first", &[ROWS, COLUMNS], recorded.get("in.valid")[..PIXELS].to_vec())),
    };
    let scored = |case: &mut Case, [score, label]: [&str; 2], each: &[usize]| Scored {
        probability: case.input(score, each, recorded.get(score)),
        label: case.input(label, each, recorded.get(label)),
        labelled: case.input(&format!("{label}.known"), each, vec![1.0; each.iter().product()]),
    };
    let tokens = [IMAGES, PIXELS / PATCH / PATCH];
    let score = Scores {
        pixels: scored(&mut case, ["out.pixel_score", "gt.moving_label"], &maps),
        tokens: scored(&mut case, ["out.token_score", "gt.moving_label_token"], &tokens),
    };
    let terms = Terms {
        depth: Some(depths),
        rays: Some(rays),
        camera: Some(cameras),
        tracks: Some(tracks),
        displacement: None,
        score: Some(score),
    };
    (case, terms, Values { depth, ray, paths })
}

#[test]
fn every_loss_of_the_release_is_reproduced() {
    let recorded = Recorded::open("golden");
    let (mut case, terms, _) = terms(&recorded, false);
    let losses = terms.record(&mut case.graph, &LossConfig::release()).expect("records");
    assert_eq!(losses.names.last().map(String::as_str), Some("loss.total"));
    let numbers = [
        ("loss.camera", "camera/value"),
        ("loss.camera.translation", "camera/parts/loss_T"),
        ("loss.camera.rotation", "camera/parts/loss_R"),
        ("loss.camera.fov", "camera/parts/loss_FL"),
        ("loss.depth", "depth/value"),
        ("loss.depth.conf", "depth/parts/loss_conf_depth"),
        ("loss.depth.reg", "depth/parts/loss_reg_depth"),
        ("loss.depth.slope", "depth/parts/loss_grad_depth"),
        ("loss.ray", "ray/value"),
        ("loss.ray.conf", "ray/parts/loss_conf_ray"),
        ("loss.ray.reg", "ray/parts/loss_reg_ray"),
        ("loss.trajectory", "trajectory/value"),
        ("loss.trajectory.conf", "trajectory/parts/loss_conf_trajectory"),
        ("loss.trajectory.reg", "trajectory/parts/loss_reg_trajectory"),
        ("loss.score", "score/value"),
        ("loss.score.pixel", "score/parts/loss_pts3d_dynamic_score"),
        ("loss.score.token", "score/parts/loss_token_dynamic_score"),
        ("loss.total", "total"),
    ];
    for gpu in tiers() {
        let ready = case.run(&gpu);
        for (name, path) in numbers {
            assert_number(&ready, name, recorded.number(path), 1e-5);
        }
        // Every output is compared, but for the counts.
        let counts = losses.names.iter().filter(|name| name.ends_with(".entries")).count();
        assert_eq!(losses.names.len(), numbers.len() + counts);
        let known = case.data("known").iter().sum::<f32>();
        assert_eq!(ready.read("loss.trajectory.entries").expect("reads"), [known]);
    }
}

#[test]
fn the_sampled_trajectory_term_is_reproduced() {
    let recorded = Recorded::open("golden");
    let (mut case, mut terms, _) = terms(&recorded, true);
    (terms.depth, terms.rays, terms.camera, terms.score) = (None, None, None, None);
    terms.record(&mut case.graph, &LossConfig::release()).expect("records");
    case.inputs
        .retain(|(name, _)| ["paths", "out.trajectory_conf", "truth", "known", "counted"].contains(&name.as_str()));
    let ready = case.run(gpu());
    assert_number(&ready, "loss.trajectory", recorded.number("trajectory_sampled/value"), 1e-5);
    let part = |leaf: &str| recorded.number(&format!("trajectory_sampled/parts/loss_{leaf}_trajectory"));
    assert_number(&ready, "loss.trajectory.conf", part("conf"), 1e-5);
    assert_number(&ready, "loss.trajectory.reg", part("reg"), 1e-5);
}

#[test]
fn gradients_of_depth_rays_and_points_are_reproduced() {
    let recorded = Recorded::open("golden");
    let (mut case, terms, values) = terms(&recorded, false);
    let losses = terms.record(&mut case.graph, &LossConfig::release()).expect("records");
    // Points along the rays, whose gradient is the recorded one.
    let g = &mut case.graph;
    let mut along = |start: usize| {
        let half = g.slice(values.ray, 3, start, 3).expect("slices");
        g.resize(half, ROWS, COLUMNS, Filter::Bilinear, Corners::HalfPixel).expect("resizes")
    };
    let (direction, origin) = (along(0), along(3));
    let reach = g.zip_rows(Binary::Mul, direction, values.depth).expect("multiplies");
    let points = g.add_values(reach, origin).expect("adds");
    g.output(points, "points");
    let given = case.input("given", &[IMAGES, ROWS, COLUMNS, 3], recorded.get("grad_output.pts3d"));
    let g = &mut case.graph;
    let one = g.constant("one", g.shape(losses.total).clone(), vec![1.0]);
    let leaves = [("depth", values.depth), ("ray", values.ray), ("paths", values.paths)];
    let found = g
        .differentiate_from(&[(losses.total, one), (points, given)], &leaves.map(|(_, value)| value))
        .expect("differentiates");
    for ((name, _), gradient) in leaves.iter().zip(found) {
        g.output(gradient.expect("the loss depends on it"), &format!("gradient.{name}"));
    }

    let ready = case.run(gpu());
    let read = |name: &str| ready.read(name).expect("reads");
    assert_close("points", &read("points"), &recorded.get("out.points"), 1e-6);
    let from_paths = back_to_points(&recorded, &read("gradient.paths"));
    assert_close("pts3d", &from_paths, &recorded.get("grad_output.pts3d"), 1e-4);
    assert_close("depth", &read("gradient.depth"), &recorded.get("grad_output.depth"), 1e-4);
    assert_close("ray", &read("gradient.ray"), &recorded.get("grad_output.ray"), 1e-4);
}

#[test]
fn labels_follow_from_the_true_trajectories() {
    let recorded = Recorded::open("golden");
    let truth = truth(&recorded);
    let (mut pixels, mut tokens) = (Vec::new(), Vec::new());
    for image in truth.chunks_exact(IMAGES * PIXELS * 3) {
        let of_pixels = labels::of_pixels(image, PIXELS, None).expect("labels");
        tokens.extend(labels::of_tokens(&of_pixels, [ROWS, COLUMNS], PATCH).expect("labels").label);
        pixels.extend(of_pixels.label);
    }
    assert_eq!(pixels, recorded.get("gt.moving_label"));
    assert_eq!(tokens, recorded.get("gt.moving_label_token"));
}
