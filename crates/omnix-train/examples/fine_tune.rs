//! Training without the program: the motion of the embedded network is fine-tuned on a handful of samples; its geometry stays as it
//! is. The program's own loop ([`omnix_train::run`]) is not used, so that every step can be seen; the result is a checkpoint
//! like any other.
//!
//! `cargo run -p omnix-train --example fine_tune -- out/fine_tune`

#![expect(clippy::print_stdout, reason = "an example prints what it did")]

use std::path::{Path, PathBuf};

use omnix_data::{Sample, normalise};
use omnix_kernels::{Gpu, adapter};
use omnix_model::NetworkConfig;
use omnix_train::checkpoint::{Progress, save};
use omnix_train::config::Recipe;
use omnix_train::device::ready;
use omnix_train::shapes::Shapes;
use omnix_train::{LossValues, Session, Step as _, Update};

/// What `omnix train` would read from a file. Tensors of the first group whose name is part of theirs are trained at its rate.
const CONFIG: &str = r#"
steps = 6
sample = { images = 2, size = [112, 84] }
optimiser = { decay = 0.0, accumulate = 3 }
network = "config.json"
[[group]]
name = "st_mod"
rate = 2e-4
[[group]]
name = "offset_head"
rate = 2e-4
[[group]]
name = ""
frozen = true
"#;

fn main() -> Result<(), Box<dyn std::error::Error + Send + Sync>> {
    let out = std::env::args_os().nth(1).map_or_else(|| PathBuf::from("out/fine_tune"), PathBuf::from);
    let nano = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../assets/weights/nano");
    let network_json = serde_json::from_str(&std::fs::read_to_string(nano.join("config.json"))?)?;
    let mut config: omnix_train::config::Config = toml::from_str(CONFIG)?;
    config.start = omnix_train::config::Start::Checkpoint { path: nano };
    let network = NetworkConfig::from_json(&network_json)?;
    let recipe = Recipe { config, network_json, network };

    // Your own samples: images, cameras, depth, and where known the paths of pixels. Here moving boxes and spheres.
    let shapes = Shapes::new(recipe.config.sample.images, recipe.config.sample.size)?;
    let samples: Vec<Sample> =
        (0..3).map(|n| Ok(normalise(shapes.sample(1, n)?)?.sample)).collect::<Result<_, omnix_train::TrainError>>()?;

    let adapter = adapter::choose(None)?;
    let (device, queue) = adapter::open(&adapter)?;
    let session = Session::open(recipe, &out)?;
    let mut step = ready(&session, &Gpu::new(&device, &queue), None)?;
    let config = &session.recipe().config;
    println!("{} numbers are trained", step.layout().parameters());

    // A gradient is the mean over all samples.
    for number in 1..=config.steps {
        let mut losses = LossValues::default();
        for (index, sample) in samples.iter().enumerate() {
            losses.add(&step.train(sample, index as u64)?, 1.0 / samples.len() as f64);
        }
        let norm = step.apply(&Update {
            step: number,
            samples: samples.len() as u32,
            rates: config.group.iter().map(|group| group.rate.unwrap_or(0.0)).collect(),
            decays: config.group.iter().map(|group| config.decay(group)).collect(),
            clip: Some(config.optimiser.clip),
            average: None,
        })?;
        println!("step {number}: loss {:.4}, norm of the gradient {norm:.3}", losses.total);
    }

    let mut progress = Progress::new(config.seed, config.settings());
    progress.step = config.steps;
    save(&out, &session.recipe().network_json, &progress, &mut step, false)?;
    println!("the checkpoint is in {0}: omnix reconstruct CLIP --weights {0}", out.display());
    Ok(())
}
