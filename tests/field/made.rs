//! Runs of the embedded network, as it is or with other settings or weights.

use std::borrow::Cow;
use std::path::Path;

use omnix::{Engine, Event, Field, Request, RunPlan, Session, Weights};
use omnix_tests::{Rng, gpu};
use serde_json::Value;

pub(crate) const HEIGHT: usize = 42;
pub(crate) const WIDTH: usize = 56;

pub(crate) fn engine() -> Engine {
    Engine::new(&gpu().device, &gpu().queue)
}

/// Images with structure, `[3, H, W]`, normalised.
pub(crate) fn image(seed: u32) -> Vec<f32> {
    Rng::new(u64::from(seed) + 1).normal(3 * HEIGHT * WIDTH)
}

pub(crate) fn request(images: usize) -> Request {
    Request::new(images, HEIGHT, WIDTH).motion(true)
}

/// Ready to run the request over different images.
pub(crate) fn session(engine: &Engine, weights: &Weights, request: &Request) -> Session {
    let plan = RunPlan::new(weights, request, engine.caps()).unwrap();
    let mut session = Session::new(engine, weights, plan, &mut omnix::quiet()).unwrap();
    show(&mut session, request.images);
    session
}

/// Gives a session its images, which a run uses up.
pub(crate) fn show(session: &mut Session, images: usize) {
    (0..images).for_each(|i| session.set_image(i, &image(i as u32)).unwrap());
}

/// Runs the request over different images.
pub(crate) fn field(weights: &Weights, request: &Request) -> Field {
    made(&mut session(&engine(), weights, request))
}

/// Runs a session that was given its images, for the field.
pub(crate) fn made(session: &mut Session) -> Field {
    let mut field = None;
    let run = session.run(&mut |event| {
        if let Event::Field(made) = event {
            field = Some(*made);
        }
        Ok(())
    });
    run.unwrap();
    field.expect("motion was asked for")
}

pub(crate) fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|v| v.to_bits()).collect()
}

/// The embedded network with its configuration changed by `config` and tensors by `tensor` (its name and numbers).
pub(crate) fn changed(config: impl Fn(&mut Value), tensor: impl Fn(&str, &mut [f32])) -> Weights {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/weights/nano");
    let mut settings: Value = serde_json::from_slice(&std::fs::read(from.join("config.json")).unwrap()).unwrap();
    config(&mut settings);
    let bytes = std::fs::read(from.join("model.safetensors")).unwrap();
    let file = omnix::checkpoint::TensorFile::from_bytes(Cow::Owned(bytes), "nano").unwrap();
    let tensors: Vec<(String, Vec<usize>, Vec<u8>)> = file
        .tensors()
        .map(|(name, info)| {
            let mut numbers = file.tensor(name).unwrap().to_f32();
            tensor(name, &mut numbers);
            (name.to_owned(), info.shape.clone(), numbers.iter().flat_map(|v| v.to_le_bytes()).collect())
        })
        .collect();
    let views = tensors.iter().map(|(name, shape, data)| {
        (name.as_str(), safetensors::tensor::TensorView::new(safetensors::Dtype::F32, shape.clone(), data).unwrap())
    });
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("config.json"), settings.to_string()).unwrap();
    std::fs::write(dir.path().join("model.safetensors"), safetensors::serialize(views, None).unwrap()).unwrap();
    // The mapping outlives the folder's names.
    Weights::open(dir.path()).unwrap()
}
