//! Where points come from: a saved field, or a run or data set that `omnix-data` reads.

use std::path::Path;

use omnix::geometry::Camera;
use omnix::render::{ImagePoints, Source};
use omnix::windows::FilmField;
use omnix::{Engine, Field, OmnixError};
use omnix_data::{Flag, Motion, PIXEL, Pick, ReadOptions, Sample, Set, read, sets};

use crate::error::CliError;

const FIELD: &str = "field.safetensors";

/// Opens what lies at `path`.
pub(super) fn open(engine: &Engine, path: &Path, video: Option<usize>) -> Result<Box<dyn Source>, CliError> {
    let field = if path.is_dir() { path.join(FIELD) } else { path.to_owned() };
    if field.is_file() || !path.is_dir() {
        if video.is_some() {
            return Err(CliError::Usage(
                "--video is for scenes and for runs without a field: choose --times".to_owned(),
            ));
        }
        return of_field(engine, &field);
    }
    if sets::of_folder(path).is_none() {
        return Err(CliError::NothingToRender { path: path.to_owned() });
    }
    let scene = sets::open(path, None)?;
    let count = scene.videos().len();
    let videos = match video {
        Some(video) if video >= count => {
            return Err(CliError::Usage(format!(
                "there is no video {video}: videos go from 0 to {}",
                count.saturating_sub(1)
            )));
        }
        Some(video) => video..video + 1,
        None if scene.set() == Set::Output => 0..count,
        None => 0..count.min(1),
    };
    let picks: Vec<Pick> = videos
        .flat_map(|video| (0..scene.videos()[video].frames).map(move |frame| Pick::plain(video, frame)))
        .collect();
    let sample = read(scene.as_ref(), &picks, &ReadOptions::default())?;
    if sample.count() == 0 || (sample.depth(0).is_none() && sample.positions(0, 0).is_none()) {
        return Err(CliError::NothingToRender { path: path.to_owned() });
    }
    Ok(Box::new(Known(sample)))
}

/// A saved field of a run, or of a film in windows.
fn of_field(engine: &Engine, path: &Path) -> Result<Box<dyn Source>, CliError> {
    if !FilmField::is_one(path) {
        return Ok(Box::new(Field::open(engine, path)?));
    }
    let film = FilmField::open(engine, path)?;
    match film.parts().len() {
        1 => Ok(Box::new(film)),
        parts => Err(CliError::Usage(format!(
            "the film of {} has {parts} parts, each with a world of its own: render one of them, such as its folder part_000, of a run with \
             --export npz",
            path.display()
        ))),
    }
}

/// A sample as a source: depth and, where the data set has them, paths.
struct Known(Sample);

impl Source for Known {
    fn size(&self) -> [usize; 2] {
        self.0.size().map(|side| side as usize)
    }

    fn cameras(&self) -> Vec<Camera> {
        self.0.cameras().to_vec()
    }

    fn image(&self, image: usize) -> Result<ImagePoints, OmnixError> {
        let sample = &self.0;
        let (width, pixels) = (sample.size()[0] as usize, sample.pixels());
        let positions = match (sample.depth(image), sample.positions(image, image)) {
            (Some(depth), _) => {
                let lift = Lift::new(&sample.cameras()[image]);
                (0..pixels).map(|i| lift.world(i % width, i / width, depth[i])).collect()
            }
            (None, Some(own)) => own.to_vec(),
            (None, None) => vec![[f32::NAN; 3]; pixels],
        };
        let paths = matches!(sample.motion(), Motion::Dense(_));
        let moving = |i: usize| paths && sample.moving(image).is_none_or(|moving| moving[i] != Flag::No);
        Ok(ImagePoints {
            positions,
            colours: sample.image(image).as_chunks().0.to_vec(),
            confidence: None,
            moving: (0..pixels).map(moving).collect(),
        })
    }

    fn positions(&self, image: usize, pixels: &[u32], time: usize) -> Result<Vec<[f32; 3]>, OmnixError> {
        let all = self.0.positions(image, time).unwrap_or_default();
        Ok(pixels.iter().map(|pixel| all.get(*pixel as usize).copied().unwrap_or([f32::NAN; 3])).collect())
    }
}

/// From pixels and depth to the world.
struct Lift {
    c2w: [[f32; 4]; 3],
    lens: [[f32; 3]; 3],
}

impl Lift {
    fn new(camera: &Camera) -> Self {
        Self { c2w: omnix::geometry::invert_pose(&camera.extrinsics), lens: camera.intrinsics }
    }

    fn world(&self, x: usize, y: usize, depth: f32) -> [f32; 3] {
        let [[fx, skew, cx], [_, fy, cy], _] = self.lens;
        let offset = PIXEL.offset() as f32;
        let v = (y as f32 + offset - cy) / fy;
        let u = (x as f32 + offset - cx - skew * v) / fx;
        self.c2w.map(|row| (row[0] * u + row[1] * v + row[2]) * depth + row[3])
    }
}
