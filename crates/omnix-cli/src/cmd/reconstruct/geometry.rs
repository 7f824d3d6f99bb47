//! The first part of a run: pictures to the network's size, the network, and each image's depth and camera into the sinks.

use std::time::Instant;

use omnix::geometry::{Agreement, RayMaps, SKY, cameras_from_rays, sample_table};
use omnix::io::output::{FeatureMap, SourcePicture};
use omnix::io::preprocess::exported_picture;
use omnix::io::{FrameLoader, FrameResult, IoError, Picture, PictureSpool, PlannedFrame, Sink, Stop};
use omnix::windows::Cuts;
use omnix::{Camera, Event, Field, OmnixError, Phase, Session};
use serde_json::{Value, json};

use super::state::{Run, begin};
use crate::error::CliError;
use crate::job::Job;
use crate::stop;
use crate::ui::Ui;

/// Degrees, and parts of the cameras' extent, from which on known cameras do not seem to be those of the pictures.
const APART: (f64, f64) = (30.0, 0.5);

/// Says how well the known cameras and the network's own agree.
fn tell_agreement(agreement: &Agreement, ui: &mut Ui) {
    let Agreement { scale, turned, moved } = *agreement;
    ui.event("cameras", json!({ "scale": scale, "turned_degrees": turned, "moved": moved }));
    ui.say(&format!(
        "known cameras and the network's own: turned apart by {:.1} degrees (at most {:.1}), centres by {:.0} % of their extent (at most {:.0} %); \
         a unit of theirs is {scale:.3} of the network's",
        turned[0], turned[1], 100.0 * moved[0], 100.0 * moved[1]
    ));
    if turned[0] > APART.0 || moved[0] > APART.1 {
        ui.note(
            "note: the known cameras do not seem to be those of these pictures: check names, order, axes and mirroring",
        );
    }
}

impl Run<'_> {
    /// Every picture at the network's size, 8 bits per channel, in a file of the output folder; where the film is cut, to `cuts`.
    pub(super) fn read(&mut self, mut cuts: Option<&mut Cuts>, ui: &mut Ui) -> Result<PictureSpool, CliError> {
        let input = &self.job.input;
        let total = input.frames.len();
        ui.begin("read", &format!("reading {total} image(s)"));
        let mut loader = FrameLoader::new(input).stop(Stop::when(stop::asked));
        let (width, height) = self.job.preparation.size();
        let mut pictures = PictureSpool::new(self.dir, width, height)?;
        for index in 0..total {
            if stop::asked() {
                return Err(OmnixError::Interrupted.into());
            }
            let mut picture = loader.load(index)?;
            // Networks see straight lines; so do the pictures that results are beside.
            if let Some(known) =
                self.job.known.as_ref().map(|known| known[index].lens).filter(|lens| !lens.distortion.is_none())
            {
                picture = known.undistort(&picture);
            }
            let picture = self.job.preparation.apply(&picture)?;
            if let Some(cuts) = &mut cuts {
                cuts.add(input.frames[index].video, &picture);
            }
            pictures.push(&picture)?;
            ui.progress(index as u64 + 1, total as u64);
        }
        self.timings.insert("read".to_owned(), json!(ui.end()));
        Ok(pictures)
    }

    /// The network, and each image's results into the sinks.
    pub(super) fn network(
        &mut self,
        session: &mut Session,
        pictures: &PictureSpool,
        ui: &mut Ui,
    ) -> Result<Option<Field>, CliError> {
        let since = Instant::now();
        let request = &self.job.request;
        let (gh, gw) = request.grid();
        let rays_size = [8 * gh, 8 * gw];
        let table = request.rays.then(|| sample_table(rays_size[0] * rays_size[1]));
        let image = [request.height as u32, request.width as u32];
        let (job, sinks, finished) = (self.job, &mut self.sinks, &mut self.finished);
        let (cameras, timings) = (&mut self.cameras, &mut self.timings);
        let names = self.job.input.picture_names();
        let mut phase = None;
        let mut field = None;
        let outcome = session.run(&mut |event| {
            let geometry = match event {
                Event::Progress(p) => {
                    if phase.replace(p.phase) != Some(p.phase) {
                        let (name, text) = said(p.phase);
                        begin(timings, ui, name, text);
                    }
                    ui.progress(p.done, p.total);
                    return stop::answer();
                }
                Event::Frame(geometry) => geometry,
                Event::MetricScale(metres) => {
                    ui.event("metric_scale", json!({ "metres": metres }));
                    let by = if job.request.distance.is_some() {
                        "by the known distance"
                    } else {
                        "as the metric network sees it"
                    };
                    ui.say(&format!("a unit of the any-view network is {metres:.3} metres, {by}"));
                    return Ok(());
                }
                Event::Agreement(agreement) => {
                    tell_agreement(&agreement, ui);
                    return Ok(());
                }
                Event::Field(made) => {
                    field = Some(*made);
                    return Ok(());
                }
                _ => return Ok(()),
            };
            let index = geometry.index;
            let camera = match (&geometry.rays, &table) {
                (Some((rays, confidence)), Some(table)) => {
                    Some(camera_of_rays(&RayMaps { rays, confidence, size: rays_size }, image, table)?)
                }
                _ => geometry.camera,
            };
            let sky = geometry.sky.as_ref().map(|sky| sky.iter().map(|s| *s >= SKY).collect::<Vec<bool>>());
            let maps = geometry.features.iter();
            let features: Vec<FeatureMap<'_>> =
                maps.map(|(block, values)| FeatureMap { block: *block, grid: [gh, gw], values }).collect();
            let shown = Shown {
                index,
                depth: &geometry.depth,
                confidence: geometry.confidence.as_deref(),
                camera,
                sky: sky.as_deref(),
                gaussians: geometry.gaussians.as_deref(),
                features: &features,
            };
            show(job, sinks, &names[index], &pictures.get(index)?, &shown)?;
            cameras.extend(camera);
            *finished = index + 1;
            ui.event("frame", frame_fields(&job.input.frames[index], &geometry.depth, since));
            Ok(())
        });
        begin(timings, ui, "", "");
        outcome?;
        Ok(field)
    }
}

/// An image's geometry, as exports get it.
pub(super) struct Shown<'a> {
    pub(super) index: usize,
    pub(super) depth: &'a [f32],
    pub(super) confidence: Option<&'a [f32]>,
    pub(super) camera: Option<Camera>,
    pub(super) sky: Option<&'a [bool]>,
    pub(super) gaussians: Option<&'a [f32]>,
    pub(super) features: &'a [FeatureMap<'a>],
}

/// Gives an image to the exports of single images. `name` is that of its source picture, `picture` the processed one.
pub(super) fn show(
    job: &Job,
    sinks: &mut [Box<dyn Sink>],
    name: &str,
    picture: &Picture,
    shown: &Shown<'_>,
) -> Result<(), IoError> {
    let frame = &job.input.frames[shown.index];
    let rgb = exported_picture(picture);
    let result = FrameResult {
        index: shown.index,
        video: frame.video,
        frame: frame.frame,
        time_s: frame.time_s,
        width: picture.width,
        height: picture.height,
        depth: shown.depth,
        confidence: shown.confidence,
        rgb: &rgb.data,
        extrinsics: shown.camera.map(|camera| camera.extrinsics),
        intrinsics: shown.camera.map(|camera| camera.intrinsics),
        sky: shown.sky,
        gaussians: shown.gaussians,
        features: shown.features,
        source: Some(SourcePicture {
            name,
            size: [frame.width, frame.height],
            framing: job.preparation.framing(frame),
        }),
    };
    sinks.iter_mut().try_for_each(|sink| sink.frame(&result))
}

/// What machines are told of an image.
pub(super) fn frame_fields(frame: &PlannedFrame, depth: &[f32], since: Instant) -> Value {
    let (min, max) = range(depth);
    json!({
        "index": frame.index, "video": frame.video, "frame": frame.frame, "time_s": frame.time_s,
        "depth_min": min, "depth_max": max, "seconds": since.elapsed().as_secs_f64(),
    })
}

/// What people read of a phase, and its name for machines.
pub(super) fn said(phase: Phase) -> (&'static str, &'static str) {
    match phase {
        Phase::Weights => ("weights", "reading weights"),
        Phase::Metric => ("metric", "the metric network over all images"),
        Phase::Backbone => ("backbone", "network over all images"),
        Phase::Head => ("head", "depth, image by image"),
        Phase::Motion => ("motion", "what moves, over all images"),
        Phase::Sampling => ("sampling", "how each pixel moves, image by image"),
        _ => ("other", "working"),
    }
}

/// The camera of one image from its rays.
fn camera_of_rays(maps: &RayMaps<'_>, image: [u32; 2], table: &[[u32; 8]]) -> Result<Camera, OmnixError> {
    let cameras = cameras_from_rays(maps, image, Some(table))?;
    let none = || OmnixError::Request { reason: "BUG: no camera for a ray map".to_owned() };
    cameras.first().map(|c| c.camera).ok_or_else(none)
}

/// Least and greatest depth of the pixels that have one.
fn range(depth: &[f32]) -> (f32, f32) {
    depth
        .iter()
        .filter(|depth| **depth > 0.0)
        .fold((f32::INFINITY, f32::NEG_INFINITY), |(a, b), d| (a.min(*d), b.max(*d)))
}
