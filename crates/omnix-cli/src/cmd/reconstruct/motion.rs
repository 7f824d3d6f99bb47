//! Exports of what moves, from the field of a run. Each file has its name only when whole, so that Ctrl-C between two of
//! them, or inside one, leaves what was finished.

use std::path::PathBuf;

use omnix::io::output::{GlbMotionOptions, HtmlOptions, MotionInput, MotionOptions, MotionStream, write_motion};
use omnix::io::{Export, PictureSpool, preprocess::exported_picture};
use omnix::{Field, OmnixError};
use serde_json::json;

use super::manifest::network_points;
use super::state::{Run, begin};
use crate::error::CliError;
use crate::stop;
use crate::ui::Ui;

/// Seed of every choice.
pub(super) const SEED: u64 = 42;
/// Images a second in files that play, where the input does not say.
const RATE: f64 = 12.0;

impl Run<'_> {
    /// Writes all of them.
    pub(super) fn export_motion(
        &mut self,
        mut field: Field,
        pictures: &PictureSpool,
        unit: &str,
        ui: &mut Ui,
    ) -> Result<(), CliError> {
        begin(&mut self.timings, ui, "exports", "following points, writing what moves");
        self.describe(&mut field, pictures, unit)?;
        let dir = self.dir;
        let dense = self.args.all_tracks;
        let (by_image, by_point): (Vec<Export>, Vec<Export>) = self
            .job
            .exports
            .iter()
            .filter(|e| e.motion_input().is_some())
            .partition(|e| e.motion_input_of(dense) == Some(MotionInput::Images));
        let images = field.shape().images;
        let mut done = 0;
        let steps = (usize::from(!by_image.is_empty()) + usize::from(!by_point.is_empty())) * images;
        let mut step = |ui: &mut Ui| {
            ui.progress(done, steps as u64);
            done += 1;
            if stop::asked() { Err(OmnixError::Interrupted) } else { Ok(()) }
        };
        if self.job.exports.contains(&Export::Field) {
            let saved = field.save(&dir.join("field.safetensors"), self.args.field_type.into())?;
            self.wrote([saved], true);
        }
        let mut stream = MotionStream::open(&by_image, field.views()?, dir)?;
        if !stream.is_empty() {
            for image in 0..images {
                step(ui)?;
                stream.image(&field.image_motion(image, stream.wants_trajectory(image))?.as_source())?;
            }
        }
        self.wrote(stream.finish(), true);
        if !by_point.is_empty() {
            let budget = self.args.followed() as usize;
            let points = field.choose(budget, SEED, &mut |_| step(ui))?;
            for export in by_point {
                if stop::asked() {
                    return Err(OmnixError::Interrupted.into());
                }
                let written = write_motion(&[export], &points, dir, &self.options(unit))?;
                self.wrote(written, true);
            }
        }
        begin(&mut self.timings, ui, "", "");
        Ok(())
    }

    /// What the engine does not know of the images; what the manifest and `--json` say of them.
    fn describe(&mut self, field: &mut Field, pictures: &PictureSpool, unit: &str) -> Result<(), CliError> {
        let frames = &self.job.input.frames;
        for ((image, frame), camera) in field.images_mut().iter_mut().zip(frames).zip(&self.cameras) {
            image.time_s = frame.time_s;
            image.camera = *camera;
        }
        for index in 0..pictures.len() {
            field.set_picture(index, exported_picture(&pictures.get(index)?))?;
        }
        let checkpoint = self.job.weights.checkpoint();
        let about = field.about_mut();
        about.weights = format!("{} blake3:{}", checkpoint.name(), checkpoint.digest());
        unit.clone_into(&mut about.unit);
        let moving = |theta: &[f32]| theta.iter().filter(|t| field.moves(**t)).count();
        let shape = *field.shape();
        let shares = (0..shape.images).map(|i| Ok(moving(&field.theta(i)?)));
        let shares = shares.collect::<Result<Vec<usize>, OmnixError>>()?;
        self.motion = json!({
            "target_times": shape.images, "levels": shape.levels, "sampling_points": shape.points, "grid": shape.grid,
            "gate": format!("{:?}", field.motion().gate), "relative_to_own_time": field.motion().relative,
            "moving_pixels": shares, "positions": "world of the extrinsics",
            "points_from": network_points(self.job.weights.network().config()), "unit": unit,
        });
        Ok(())
    }

    pub(super) fn options(&self, unit: &str) -> MotionOptions {
        let notes = self.job.weights.note().map(str::to_owned).into_iter().collect();
        let glb = GlbMotionOptions::default().max_points(self.args.followed() as usize).unit(unit.to_owned());
        let html = HtmlOptions::default().title(title(self.inputs)).notes(notes).unit(unit.to_owned());
        MotionOptions::default().fps(rate(self.job)).glb(glb).html(html)
    }
}

/// Images a second of the first video that has times, kept between what can be followed and what is smooth.
fn rate(job: &crate::job::Job) -> f64 {
    let frames = &job.input.frames;
    let gaps = frames.windows(2).filter(|w| w[0].video == w[1].video);
    let gap = gaps.filter_map(|w| Some(w[1].time_s? - w[0].time_s?)).find(|gap| *gap > 0.0);
    gap.map_or(RATE, |gap| (1.0 / gap).clamp(2.0, 60.0))
}

/// Names of the inputs, without the folders they are in: the page may be shown to others.
fn title(inputs: &[PathBuf]) -> String {
    let name = |input: &PathBuf| {
        let path = std::path::absolute(input).unwrap_or_else(|_| input.clone());
        path.file_name().map_or_else(|| "scene".to_owned(), |name| name.to_string_lossy().into_owned())
    };
    format!("omnix: {}", inputs.iter().map(name).collect::<Vec<_>>().join(", "))
}

#[cfg(test)]
mod tests {
    use super::{PathBuf, title};

    #[test]
    fn titles_name_no_folders() {
        let inputs = ["/home/ada/private/clip.mp4", "photos/trip/", "a/*.jpg"].map(PathBuf::from);
        assert_eq!(title(&inputs), "omnix: clip.mp4, trip, *.jpg");
        assert!(!title(&[PathBuf::from("..")]).contains('/'));
    }
}
