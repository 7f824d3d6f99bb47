//! Collections and networks at the edge of what is legal: results are finite and mean what they should.

use omnix::{OmnixError, Pixels, Query, RunPlan, Session, Weights};

use crate::made::{changed, engine, field, image, request};

/// Paths of all images, which must be finite.
fn paths(field: &omnix::Field) -> Vec<Vec<f32>> {
    let images = field.shape().images;
    let of = |i: usize| field.paths(&Query::new(i, Pixels::All, 0..images)).unwrap().positions;
    let all: Vec<Vec<f32>> = (0..images).map(of).collect();
    assert!(all.iter().flatten().all(|v| v.is_finite()));
    all
}

/// How far any point goes from where it is at its own time.
fn travel(field: &omnix::Field) -> f32 {
    let all = paths(field);
    let far = |(i, positions): (usize, &Vec<f32>)| {
        let points = field.points(i).unwrap();
        positions.iter().zip(points.iter().cycle()).fold(0.0f32, |w, (a, b)| w.max((a - b).abs()))
    };
    all.iter().enumerate().map(far).fold(0.0, f32::max)
}

#[test]
fn one_image_has_one_time() {
    let field = field(&Weights::builtin().unwrap(), &request(1));
    assert_eq!(field.shape().images, 1);
    assert!(travel(&field) < 1e-4, "{}", travel(&field));
    assert!(field.theta(0).unwrap().iter().all(|v| v.is_finite()));
}

#[test]
fn two_images_of_one_time() {
    let weights = Weights::builtin().unwrap();
    // The same place in the same video, and the same instant of two synchronised ones.
    for times in [vec![(0, 3), (0, 3), (0, 4)], vec![(0, 1), (1, 1), (1, 2)]] {
        let field = field(&weights, &request(3).times(times.clone()));
        paths(&field);
        let known: Vec<_> = field.images().iter().map(|i| (i.video, i.frame)).collect();
        assert_eq!(known, times);
    }
}

#[test]
fn all_scores_equal() {
    let weights = changed(
        |_| {},
        |name, numbers| {
            if name.contains("dynamic_pred_last_layer") {
                numbers.fill(0.0);
            }
        },
    );
    // A tie goes to the lower index: the same cells of every image, so pixels at the end see no chosen one.
    let field = field(&weights, &request(2));
    paths(&field);
    for image in 0..2 {
        let theta = field.theta(image).unwrap();
        let far = theta.len() - 1;
        assert!(theta[0] > theta[far], "{} {}", theta[0], theta[far]);
    }
}

#[test]
fn nothing_moves_anywhere() {
    // Fields that say "no turn, no shift" for every token that is followed.
    let still = changed(
        |_| {},
        |name, numbers| {
            let of_field = name.contains("motion_proj_list");
            if of_field && name.ends_with(".2.weight") {
                numbers.fill(0.0);
            } else if of_field && name.ends_with(".2.bias") {
                numbers.copy_from_slice(&[1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
            }
        },
    );
    // A gate that no score passes.
    let closed = changed(|config| config["trajectory"]["motion_gate"]["infer"] = 1.0.into(), |_, _| {});
    let field_of = |weights: &Weights| field(weights, &request(2));
    assert!(travel(&field_of(&closed)) == 0.0);
    let still = field_of(&still);
    let moving = (0..2).flat_map(|i| still.theta(i).unwrap().into_owned()).filter(|t| still.moves(*t)).count();
    assert!(travel(&still) < 1e-4, "{} with {moving} pixels let through", travel(&still));
    let points = field_of(&closed).choose(200, 1, &mut |_| Ok(())).unwrap();
    assert!(points.len() == 200 && points.moving.iter().all(|m| !m));
}

#[test]
fn pixels_that_are_no_numbers_are_refused() {
    let (engine, weights) = (engine(), Weights::builtin().unwrap());
    let plan = RunPlan::new(&weights, &request(2), engine.caps()).unwrap();
    let mut session = Session::new(&engine, &weights, plan, &mut omnix::quiet()).unwrap();
    let mut pixels = image(0);
    pixels[57] = f32::NAN;
    let refused = session.set_image(1, &pixels).unwrap_err().to_string();
    assert!(refused.contains("image 1") && refused.contains("NaN") && refused.contains("1,1"), "{refused}");
}

#[test]
fn a_network_without_trajectories_says_so() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("data/goldens/tiny-a");
    let weights = Weights::open(&folder).unwrap();
    let refused = RunPlan::new(&weights, &request(2), engine().caps());
    let error = refused.map(|_| ()).unwrap_err();
    assert!(matches!(error, OmnixError::NoMotion { .. }) && error.to_string().contains("OmniX checkpoint"), "{error}");
}

#[test]
fn half_precision_weights_and_the_memory_that_was_promised() {
    let request = request(4).storage(omnix::WeightType::F16);
    paths(&field(&Weights::builtin().unwrap(), &request));
}

#[test]
fn a_weight_beyond_f16_is_refused_before_work_whichever_way_weights_come() {
    let changed = changed(
        |_| {},
        |name, numbers| {
            if name.ends_with("blocks.1.attn.qkv.weight") && name.contains("backbone") {
                numbers[192 + 7] = 70000.0;
            }
        },
    );
    let engine = engine();
    for keep_weights in [true, false] {
        let with = |storage| {
            let request = request(1).storage(storage).keep_weights(keep_weights);
            let plan = RunPlan::new(&changed, &request, engine.caps()).unwrap();
            Session::new(&engine, &changed, plan, &mut omnix::quiet()).map(|_| ())
        };
        let error = with(omnix::WeightType::F16).unwrap_err().to_string();
        assert_eq!(
            error,
            "weight `backbone.pretrained.blocks.1.attn.qkv.weight[1, 7]` = 70000 does not fit in f16; store it as f32"
        );
        with(omnix::WeightType::F32).unwrap();
        with(omnix::WeightType::I8).unwrap();
    }
}
