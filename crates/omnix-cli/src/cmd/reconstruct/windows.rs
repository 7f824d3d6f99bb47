//! A film in windows: pictures into a file, window after window, joins, then image after image into the exports. Each part that
//! could not be joined to the one before has a folder of its own.
//!
//! Nothing is exported before all windows are there, and what they said stays in `windows/` of the output folder until the manifest is
//! written: a run that was stopped or killed finds there what it had computed, and leaves the same files as one that was not.

use std::path::Path;
use std::time::Instant;

use omnix::io::output::motion::{ImageTime, MotionView, MovingPoints};
use omnix::io::output::{WINDOWS, part_folder, write_motion};
use omnix::io::preprocess::{exported_picture, normalise};
use omnix::io::{Export, PictureSpool, SinkOptions, open_sinks};
use omnix::windows::{Chain, Cuts, Film, FilmFiles, Follow, Followed, Layout, Seam, Windows, field_path, still_up_to};
use omnix::{About, Engine, Event, Field, FieldImage, OmnixError};
use serde_json::{Value, json};

use super::geometry::{Shown, frame_fields, said, show};
use super::motion::SEED;
use super::state::{Run, begin};
use crate::error::CliError;
use crate::stop;
use crate::ui::Ui;
use crate::windowing::{self, WindowSize};

impl Run<'_> {
    /// Reconstructs the film and exports it.
    pub(super) fn film(
        &mut self,
        engine: &Engine,
        size: WindowSize,
        options: &SinkOptions,
        ui: &mut Ui,
    ) -> Result<(), CliError> {
        let mut cuts = Cuts::default();
        let pictures = self.read(Some(&mut cuts), ui)?;
        // Until now the folder held the results of an earlier run.
        self.folder.begin()?;
        self.begun = true;
        let request = &self.job.request;
        let layout = Layout::new(request.images, size.images, size.overlap, &cuts.found())?;
        let folder = self.dir.join(WINDOWS);
        self.compute(engine, &layout, &folder, &pictures, ui)?;
        begin(&mut self.timings, ui, "join", "joining the windows");
        let maps = [request.height, request.width];
        let seams = layout.windows().len() as u64 - 1;
        let chain = Chain::new(&layout, &folder, maps, still_up_to(&self.job.weights), &mut |seam| {
            ui.progress(seam as u64, seams);
            stop::answer()
        })?;
        begin(&mut self.timings, ui, "", "");
        tell(&chain, ui);
        self.windows = describe(&layout, &chain);
        let mut film = Film::new(&layout, &chain, &folder, maps);
        self.export(&mut film, &chain, &pictures, options, ui)?;
        for part in 0..chain.parts().len() {
            let follow = Follow { layout: &layout, chain: &chain, size: maps, part };
            self.follow(engine, &follow, &folder, &pictures, &options.unit, ui)?;
        }
        if self.job.exports.contains(&Export::Field) {
            self.save_field(engine, (&layout, &chain), &pictures, &options.unit, ui)?;
        }
        Ok(())
    }

    /// The windows' fields and what joins them.
    fn save_field(
        &mut self,
        engine: &Engine,
        (layout, chain): (&Layout, &Chain),
        pictures: &PictureSpool,
        unit: &str,
        ui: &mut Ui,
    ) -> Result<(), CliError> {
        begin(&mut self.timings, ui, "exports", "saving the windows' fields");
        let job = self.job;
        let frames = job.input.frames.iter().zip(&self.cameras);
        let images: Vec<FieldImage> = frames
            .map(|(f, camera)| FieldImage { video: f.video, frame: f.frame, time_s: f.time_s, camera: *camera })
            .collect();
        let checkpoint = job.weights.checkpoint();
        let about = About {
            network: job.weights.network().config().name.clone(),
            weights: format!("{} blake3:{}", checkpoint.name(), checkpoint.digest()),
            unit: unit.to_owned(),
            note: job.weights.note().map(str::to_owned),
            window: None,
        };
        let size = [job.request.height, job.request.width];
        let folder = &self.dir.join(WINDOWS);
        let film = FilmFiles { engine, layout, chain, folder, size, images: &images, about: &about };
        let mut picture = |image: usize| Ok::<_, OmnixError>(exported_picture(&pictures.get(image)?));
        let windows = layout.windows().len() as u64;
        let written = film.save(self.dir, self.args.field_type.into(), &mut picture, &mut |window| {
            ui.progress(window as u64, windows);
            stop::answer()
        })?;
        self.wrote(written, true);
        begin(&mut self.timings, ui, "", "");
        Ok(())
    }

    /// The windows, each into its file.
    fn compute(
        &mut self,
        engine: &Engine,
        layout: &Layout,
        folder: &Path,
        pictures: &PictureSpool,
        ui: &mut Ui,
    ) -> Result<(), CliError> {
        let job = self.job;
        let fields = windowing::need_fields(&job.exports);
        let windows = Windows { engine, weights: &job.weights, request: &job.request, layout, folder, fields };
        let (timings, computing) = (&mut self.timings, &mut self.computing);
        let mut phase = None;
        let mut numbers = |index: usize, numbers: &mut [f32]| {
            normalise(&pictures.get(index)?, numbers);
            Ok::<_, OmnixError>(())
        };
        let outcome = windows.run(&mut numbers, &mut |event| {
            match event {
                Event::Progress(p) => {
                    if phase.replace(p.phase) != Some(p.phase) {
                        let (name, text) = said(p.phase);
                        begin(timings, ui, name, text);
                    }
                    ui.progress(p.done, p.total);
                }
                Event::Window(window) => {
                    phase = None;
                    begin(timings, ui, "", "");
                    *computing = Some((window.index, window.windows));
                    let (first, last) = (window.images.start, window.images.end - 1);
                    let found = if window.found { ", found from an earlier run" } else { "" };
                    ui.event(
                        "window",
                        json!({
                            "index": window.index, "windows": window.windows, "images": [first, last], "found": window.found,
                        }),
                    );
                    ui.say(&format!(
                        "window {} of {}: images {first} to {last}{found}",
                        window.index + 1,
                        window.windows
                    ));
                }
                _ => {}
            }
            stop::answer()
        });
        begin(timings, ui, "", "");
        outcome?;
        *computing = None;
        Ok(())
    }

    /// Every image into the exports of its part.
    fn export(
        &mut self,
        film: &mut Film<'_>,
        chain: &Chain,
        pictures: &PictureSpool,
        options: &SinkOptions,
        ui: &mut Ui,
    ) -> Result<(), CliError> {
        begin(&mut self.timings, ui, "exports", "writing the film, image by image");
        let (since, job) = (Instant::now(), self.job);
        let names = job.input.picture_names();
        let several = chain.parts().len() > 1;
        for (part, images) in chain.parts().iter().enumerate() {
            if several {
                // Those that were opened before anything was computed have got nothing.
                self.sinks = open_sinks(&job.exports, &self.dir.join(part_folder(part)), options)?;
            }
            for index in images.clone() {
                if stop::asked() {
                    return Err(OmnixError::Interrupted.into());
                }
                let found = film.image(index)?;
                let shown = Shown {
                    index,
                    depth: &found.depth,
                    confidence: Some(&found.confidence),
                    camera: Some(found.camera),
                    sky: None,
                    gaussians: None,
                    features: &[],
                };
                show(job, &mut self.sinks, &names[index], &pictures.get(index)?, &shown)?;
                self.cameras.push(found.camera);
                self.finished = index + 1;
                ui.event("frame", frame_fields(&job.input.frames[index], &found.depth, since));
                ui.progress(index as u64 + 1, job.request.images as u64);
            }
            if several {
                self.close_sinks(false)?;
            }
        }
        begin(&mut self.timings, ui, "", "");
        Ok(())
    }
}

impl Run<'_> {
    /// The paths of chosen points of a part, if any export wants them.
    fn follow(
        &mut self,
        engine: &Engine,
        follow: &Follow<'_>,
        folder: &Path,
        pictures: &PictureSpool,
        unit: &str,
        ui: &mut Ui,
    ) -> Result<(), CliError> {
        let exports = windowing::of_points(&self.job.exports);
        let (images, all) = (follow.chain.parts()[follow.part].clone(), self.job.request.images as u64);
        if exports.is_empty() {
            return Ok(());
        }
        begin(&mut self.timings, ui, "exports", "following points through the windows");
        let budget = self.job.followed(self.args) * images.len() as u64 / all;
        let mut open = |k: usize| {
            let field: Box<dyn omnix::windows::WindowField> = Box::new(Field::open(engine, &field_path(folder, k))?);
            Ok(field)
        };
        let followed = follow.points(budget as usize, SEED, &mut open, &mut |done, steps| {
            ui.progress(done as u64, steps as u64);
            stop::answer()
        })?;
        let points = self.moving_points(followed, images, pictures)?;
        let several = follow.chain.parts().len() > 1;
        let dir = if several { self.dir.join(part_folder(follow.part)) } else { self.dir.to_owned() };
        let written = write_motion(&exports, &points, &dir, &self.options(unit))?;
        self.wrote(written, true);
        begin(&mut self.timings, ui, "", "");
        Ok(())
    }

    /// Followed points as exports take them; images are counted from the part's first.
    fn moving_points(
        &self,
        followed: Followed,
        images: std::ops::Range<usize>,
        pictures: &PictureSpool,
    ) -> Result<MovingPoints, CliError> {
        let Followed { source, pixel, positions, theta, confidence, moving } = followed;
        let view = |index: usize| {
            let (frame, camera) = (&self.job.input.frames[index], &self.cameras[index]);
            Ok::<_, CliError>(MotionView {
                extrinsics: camera.extrinsics,
                intrinsics: camera.intrinsics,
                time: ImageTime { video: frame.video, frame: frame.frame, time_s: frame.time_s },
                picture: exported_picture(&pictures.get(index)?),
            })
        };
        let views = images.clone().map(view).collect::<Result<Vec<_>, _>>()?;
        let source: Vec<u32> = source.iter().map(|image| (image - images.start) as u32).collect();
        let colour = |(&image, &[x, y]): (&u32, &[u32; 2])| {
            let picture = &views[image as usize].picture;
            let at = 3 * (y * picture.width + x) as usize;
            std::array::from_fn(|channel| picture.data[at + channel])
        };
        let colours = source.iter().zip(&pixel).map(colour).collect();
        Ok(MovingPoints { views, source, pixel, positions, colours, motion: theta, confidence, moving })
    }
}

/// Says what became of the joins.
fn tell(chain: &Chain, ui: &mut Ui) {
    for seam in chain.seams() {
        ui.event("join", seam_fields(seam));
        let [a, b] = seam.windows.map(|window| window + 1);
        match &seam.outcome {
            Ok(join) => ui.detail(&format!(
                "windows {a} and {b}: joined by {} points of {} images, {:.2} % of the depth apart, scale {:.3}",
                join.points,
                join.images,
                100.0 * join.residual[0],
                join.similarity.scale
            )),
            Err(apart) => ui.note(&format!("note: windows {a} and {b} are not joined: {apart}")),
        }
    }
    let parts = chain.parts();
    if parts.len() > 1 {
        let ranges: Vec<String> = parts.iter().map(|part| format!("{} to {}", part.start, part.end - 1)).collect();
        ui.note(&format!(
            "note: the film has {} parts, each with a world and a scale of its own in a folder of its own: images {}",
            parts.len(),
            ranges.join(", ")
        ));
    }
}

/// What the manifest says of windows. Ranges are first and last image.
fn describe(layout: &Layout, chain: &Chain) -> Value {
    let range = |images: &std::ops::Range<usize>| json!([images.start, images.end - 1]);
    let several = chain.parts().len() > 1;
    let window = |(window, place): (&omnix::windows::Window, &omnix::windows::Placement)| {
        let to = &place.to_part;
        json!({
            "images": range(&window.images), "shot": window.shot, "part": place.part,
            "to_part": { "scale": to.scale, "rotation": to.rotation, "translation": to.translation },
        })
    };
    let part = |(number, images): (usize, &std::ops::Range<usize>)| json!({ "images": range(images), "folder": if several { part_folder(number) } else { String::new() } });
    json!({
        "windows": layout.windows().iter().zip(chain.placements()).map(window).collect::<Vec<_>>(),
        "joins": chain.seams().iter().map(seam_fields).collect::<Vec<_>>(),
        "parts": chain.parts().iter().enumerate().map(part).collect::<Vec<_>>(),
        "meaning": "to_part maps a window's world to its part's: y = scale * rotation * x + translation; residual is the distance of the two \
                    places of a point in parts of its depth, moved that of the two centres of a camera in parts of the median depth",
    })
}

/// A seam, for the manifest and for machines.
fn seam_fields(seam: &Seam) -> Value {
    let images = if seam.images.is_empty() { Value::Null } else { json!([seam.images.start, seam.images.end - 1]) };
    let mut fields = json!({ "windows": seam.windows, "images": images, "joined": seam.outcome.is_ok() });
    let join = match &seam.outcome {
        Ok(join) => Some(*join),
        Err(apart) => {
            fields["reason"] = json!(apart.to_string());
            match apart {
                omnix::windows::Apart::Disagree(join) => Some(**join),
                _ => None,
            }
        }
    };
    if let Some(join) = join {
        fields["points"] = json!(join.points);
        fields["still"] = json!(join.still);
        fields["scale"] = json!(join.similarity.scale);
        fields["residual"] = json!({ "median": join.residual[0], "percentile_90": join.residual[1] });
        fields["depth_residual"] = json!(join.depth_residual);
        fields["turned_degrees"] = json!({ "median": join.turned[0], "largest": join.turned[1] });
        fields["moved"] = json!({ "median": join.moved[0], "largest": join.moved[1] });
    }
    fields
}
