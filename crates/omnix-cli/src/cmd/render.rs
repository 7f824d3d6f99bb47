//! `omnix render`: pictures and films of a run's points, from any camera and at any time, without a window.

mod args;
mod keys;
mod output;
mod source;
mod views;

use std::time::Instant;

use omnix::render::{Marks, RenderPlan, Renderer, Shown, Stage, StageOptions, dots};
use omnix::{Engine, Tier};
use serde_json::json;

pub(crate) use self::args::RenderArgs;
use self::args::{Frusta, Show, View};
use self::output::{Output, Target};
use self::views::{Frame, Views};
use crate::error::CliError;
use crate::ui::Ui;
use crate::{bytes, memory, stop};

/// Discs that trails and frusta may take.
const DOTS: usize = 400_000;
/// The program, the driver and its compiler, beside the points.
const PROGRAM: u64 = 131 << 20;

/// Makes the pictures.
pub(crate) fn run(args: &RenderArgs, ui: &mut Ui) -> Result<(), CliError> {
    let since = Instant::now();
    let target = Target::of(&args.out);
    target.check(args.background.0.is_some())?;
    let engine = args.device.open()?;
    let source = source::open(&engine, &args.input, args.video)?;
    let cameras = source.cameras();
    let views = Views::new(args, cameras.len())?;
    let frames = views.frames(args, target)?;
    let options =
        StageOptions { points: args.points as usize, conf_percentile: args.conf_percentile, splat: args.splat as f32 };
    plan(args, &engine, Stage::bound(source.as_ref(), &options), frames.len(), cameras.len(), ui)?;
    target.make(&args.out, frames.len(), args.size)?;
    stop::keep_results();

    ui.begin("read", "reading points");
    let images = cameras.len() as u64;
    let mut stage = Stage::read(source.as_ref(), &options, &mut |image| {
        ui.progress(image as u64, images);
        stop::answer()
    })?;
    let [moving, points] = stage.count();
    let frusta = match args.frusta {
        Frusta::Auto => !matches!(args.view, View::Input | View::Spline),
        frusta => frusta == Frusta::Yes,
    };
    let marks = Marks::new(&stage, source.as_ref(), args.trails as usize, frusta)?;
    ui.end();

    let shown = if args.show == Show::All { Shown::All } else { Shown::Nearest };
    let most = stage.most_shown(shown);
    let renderer = Renderer::new(&engine, RenderPlan::new(most + DOTS, args.size, engine.caps())?)?;
    let behind = args.background.0.unwrap_or([0; 3]);
    let cover = if args.background.0.is_some() { 1.0 } else { 0.0 };
    let mut output = Output::begin(target, &args.out, args.size, args.fps, cover < 1.0)?;
    ui.begin("render", &format!("{} picture(s) of {points} point(s) to {}", frames.len(), args.out.display()));
    if shown == Shown::All {
        renderer.write_positions(moving, stage.still())?;
        let mut first = 0;
        for (sizes, colours) in stage.looks() {
            renderer.write_looks(first, sizes, colours)?;
            first += sizes.len();
        }
    }
    for (index, frame) in frames.iter().enumerate() {
        if stop::asked() {
            return Err(output.interrupted(index, frames.len(), &args.out));
        }
        place(&renderer, &mut stage, source.as_ref(), frame, shown)?;
        let shot = views.shot(
            args,
            &stage,
            frame,
            [f32::from(behind[0]), f32::from(behind[1]), f32::from(behind[2])].map(|v| v / 255.0),
            cover,
        );
        let lines = marks.lines(frame.time, args.trail_length, behind, args.size[1] as f32 / 720.0);
        let dots = dots(&lines, &shot, args.size, DOTS);
        renderer.write_positions(most, &dots.positions)?;
        renderer.write_looks(most, &dots.sizes, &dots.colours)?;
        renderer.empty(most + dots.sizes.len(), DOTS - dots.sizes.len())?;
        if let Err(error) = output.picture(&renderer.picture(&shot)?) {
            // A signal ends the encoder too.
            return Err(if stop::asked() { output.interrupted(index, frames.len(), &args.out) } else { error });
        }
        ui.progress(index as u64 + 1, frames.len() as u64);
    }
    output.finish()?;
    ui.end();
    let seconds = since.elapsed().as_secs_f64();
    let fields = json!({
        "out": args.out, "pictures": frames.len(), "points": points, "moving": moving, "trails": marks.trails(), "seconds": seconds,
    });
    ui.event("done", fields);
    ui.say(&format!("{} picture(s) in {seconds:.1} s: {}", frames.len(), args.out.display()));
    Ok(())
}

/// Says what it will take, and refuses what does not fit.
fn plan(
    args: &RenderArgs,
    engine: &Engine,
    points: usize,
    pictures: usize,
    images: usize,
    ui: &mut Ui,
) -> Result<(), CliError> {
    let peak = RenderPlan::new(points + DOTS, args.size, engine.caps())?.peak_bytes();
    // Places, radii, colours and pixels, places at three times, one image as it is read, and a picture.
    let [width, height] = args.size.map(u64::from);
    let host = (points as u64) * (24 + 36) + width * height * 24;
    let software = engine.caps().tier != Tier::Gpu;
    let process = PROGRAM + host + if software { peak } else { 0 };
    let fields = json!({
        "pictures": pictures, "size": args.size, "images": images, "points": points, "peak_bytes": peak, "process_bytes": process,
    });
    ui.event("plan", fields);
    ui.say(&format!(
        "{pictures} picture(s) of at most {points} point(s) from {images} image(s): at most {} on the device, {} in the process",
        bytes::show(peak),
        bytes::show(process)
    ));
    let budget = args.memory_budget.or_else(|| memory::available().filter(|_| software).map(|free| free / 5 * 4));
    let needed = if software { process } else { peak };
    match budget {
        Some(budget) if needed > budget => Err(CliError::PicturesTooLarge { needed, budget }),
        _ => Ok(()),
    }
}

/// Puts the points where they are in a picture.
fn place(
    renderer: &Renderer,
    stage: &mut Stage,
    source: &dyn omnix::render::Source,
    frame: &Frame,
    shown: Shown,
) -> Result<(), CliError> {
    let moving = stage.moving_at(source, frame.time)?;
    if shown == Shown::All {
        if !moving.is_empty() {
            renderer.write_positions(0, &moving)?;
        }
        return Ok(());
    }
    let image = (frame.time.round() as usize).min(stage.cameras().len() - 1);
    let ranges = stage.of_image(image);
    let places = [&moving[ranges[0].clone()], &stage.still()[ranges[1].clone()]];
    let mut at = 0;
    for ((places, (sizes, colours)), range) in places.into_iter().zip(stage.looks()).zip(ranges) {
        renderer.write_positions(at, places)?;
        renderer.write_looks(at, &sizes[range.clone()], &colours[range])?;
        at += places.len();
    }
    Ok(renderer.empty(at, stage.most_shown(shown) - at)?)
}
