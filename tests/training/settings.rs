//! Settings of a recipe through whole steps on the device.

use std::fs;
use std::path::Path;
use std::sync::atomic::AtomicBool;

use omnix_kernels::{Gpu, adapter};
use omnix_model::NetworkConfig;
use omnix_train::config::{Copies, Recipe};
use omnix_train::device::ready;
use omnix_train::{Event, RunOptions, Session, read_config, run};

fn smoke() -> Recipe {
    read_config(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../recipes/smoke.toml")).unwrap()
}

/// Trains until a number of steps is done; the loss of each, and the figures of each validation.
fn train(recipe: Recipe, out: &Path, until: u64) -> (Vec<f64>, Vec<Vec<&'static str>>) {
    let (device, queue) = adapter::open(&adapter::choose(None).unwrap()).unwrap();
    let mut session = Session::open(recipe, out).unwrap();
    let mut step = ready(&session, &Gpu::new(&device, &queue), None).unwrap();
    let (mut losses, mut figures) = (Vec::new(), Vec::new());
    run(&mut session, &mut step, RunOptions::new(until, &AtomicBool::new(false)), &mut |event| match event {
        Event::Step { figures, .. } => losses.push(figures.losses.total),
        Event::Validated { figures: found, .. } => figures.push(found.iter().map(|(name, _)| *name).collect()),
        _ => {}
    })
    .unwrap();
    (losses, figures)
}

fn state(out: &Path) -> [Vec<u8>; 2] {
    ["last/model.safetensors", "last/state.safetensors"].map(|file| fs::read(out.join(file)).unwrap())
}

#[test]
fn f16_copies_train_and_go_on_with_the_same_bits() {
    let dir = tempfile::tempdir().unwrap();
    let [full, half, parts] = ["full", "half", "parts"].map(|name| dir.path().join(name));
    let halved = || {
        let mut recipe = smoke();
        recipe.config.weights_type = Copies::F16;
        recipe
    };
    let (in_full, figures) = train(smoke(), &full, 3);
    let (in_half, _) = train(halved(), &half, 3);
    train(halved(), &parts, 2);
    train(halved(), &parts, 3);
    assert!(state(&half) == state(&parts) && state(&half) != state(&full));
    // Weights of 11 bits change the loss a little, and change it.
    let apart = (in_half[0] / in_full[0] - 1.0).abs();
    assert!((1e-7..1e-2).contains(&apart), "{in_half:?} {in_full:?}");
    for figure in ["AbsRel", "displacement", "rotation"] {
        assert!(figures[0].contains(&figure), "{figures:?}");
    }
}

#[test]
fn images_of_several_scenes_train_a_network_without_motion() {
    let dir = tempfile::tempdir().unwrap();
    let mut recipe = smoke();
    recipe.config.sample.scenes = 2;
    recipe.network_json.as_object_mut().unwrap().remove("trajectory");
    recipe.network = NetworkConfig::from_json(&recipe.network_json).unwrap();
    let (losses, figures) = train(recipe, dir.path(), 6);
    assert!(losses[5] < losses[0], "{losses:?}");
    // Cameras of different scenes have no place to each other.
    assert_eq!(figures, [["AbsRel", "delta_1.25"]]);
}
