//! Whole runs of networks whose results depend on all images together: sky that is filled, metres. Pixels are compared where rounding
//! cannot turn the decision whether they are sky.

use omnix::geometry::OPEN_SKY;
use omnix::{Camera, Engine, Event, Request, RunPlan, Session, WeightType, Weights, quiet};
use omnix_tests::gpu;

use crate::case::Case;
use crate::ready::Report;

/// What a run told.
#[derive(Default)]
struct Told {
    depth: Vec<f32>,
    confidence: Vec<f32>,
    sky: Vec<f32>,
    cameras: Vec<Camera>,
    scale: Option<f64>,
}

/// Compares what is recorded of the results.
pub(crate) fn run(weights: &Weights, case: &Case, storage: WeightType, report: Report<'_>) -> Result<(), String> {
    let told = told(weights, case, storage)?;
    let matrices = |which: &dyn Fn(&Camera) -> Vec<f32>| told.cameras.iter().flat_map(which).collect::<Vec<f32>>();
    let extrinsics = matrices(&|camera| camera.extrinsics.concat());
    let intrinsics = matrices(&|camera| camera.intrinsics.concat());
    let scale: Vec<f32> = told.scale.iter().map(|scale| *scale as f32).collect();
    for (name, got) in [
        ("out.sky", &told.sky),
        ("out.extrinsics", &extrinsics),
        ("out.intrinsics", &intrinsics),
        ("out.scale_factor", &scale),
    ] {
        if let Some(want) = case.get(name) {
            report(name, got, &want.data);
        }
    }
    let undecided = match storage {
        WeightType::F32 => 1e-4,
        WeightType::F16 => 1e-2,
        WeightType::I8 => 1e-1,
    };
    let decided = |map: &[f32]| -> Vec<f32> {
        let pixels = map.iter().zip(&told.sky).filter(|(_, sky)| (**sky - OPEN_SKY).abs() > undecided);
        pixels.map(|(value, _)| *value).collect()
    };
    for (name, got) in [("out.depth", &told.depth), ("out.depth_conf", &told.confidence)] {
        if let Some(want) = case.get(name) {
            report(name, &decided(got), &decided(&want.data));
        }
    }
    Ok(())
}

fn told(weights: &Weights, case: &Case, storage: WeightType) -> Result<Told, String> {
    let (pixels, [count, height, width]) = case.images()?;
    let engine = Engine::new(&gpu().device, &gpu().queue).with_caps(gpu().caps.clone());
    let request = Request::new(count, height, width).storage(storage);
    let text = |e: omnix::OmnixError| e.to_string();
    let plan = RunPlan::new(weights, &request, engine.caps()).map_err(text)?;
    let mut session = Session::new(&engine, weights, plan, &mut quiet()).map_err(text)?;
    for (index, image) in pixels.data.chunks(pixels.data.len() / count).enumerate() {
        session.set_image(index, image).map_err(text)?;
    }
    let mut told = Told::default();
    let run = session.run(&mut |event| {
        match event {
            Event::MetricScale(scale) => told.scale = Some(scale),
            Event::Frame(frame) => {
                told.depth.extend(frame.depth);
                told.confidence.extend(frame.confidence.into_iter().flatten());
                told.sky.extend(frame.sky.into_iter().flatten());
                told.cameras.extend(frame.camera);
            }
            _ => {}
        }
        Ok(())
    });
    run.map_err(text)?;
    Ok(told)
}
