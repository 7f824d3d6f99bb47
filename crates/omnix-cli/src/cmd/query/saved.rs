//! A saved field to be asked: that of one run of the network, or of a film in windows.

use std::path::Path;

use omnix::windows::FilmField;
use omnix::{Engine, Field, FieldImage, OmnixError, PixelValues, Pixels, Query};

use crate::stop;

pub(super) enum Saved {
    One(Box<Field>),
    Film(Box<FilmField>),
}

impl Saved {
    pub(super) fn open(engine: &Engine, path: &Path) -> Result<Self, OmnixError> {
        Ok(if FilmField::is_one(path) {
            Self::Film(Box::new(FilmField::open(engine, path)?))
        } else {
            Self::One(Box::new(Field::open(engine, path)?))
        })
    }

    /// Height and width of an image.
    pub(super) fn size(&self) -> [usize; 2] {
        match self {
            Self::One(field) => [field.shape().height, field.shape().width],
            Self::Film(film) => film.size(),
        }
    }

    pub(super) fn images(&self) -> &[FieldImage] {
        match self {
            Self::One(field) => field.images(),
            Self::Film(film) => film.images(),
        }
    }

    pub(super) fn moves(&self, theta: f32) -> bool {
        match self {
            Self::One(field) => field.moves(theta),
            Self::Film(film) => film.moves(theta),
        }
    }

    pub(super) fn pixel_values(&self, image: usize, pixels: &Pixels) -> Result<PixelValues, OmnixError> {
        match self {
            Self::One(field) => field.pixel_values(image, pixels),
            Self::Film(film) => film.pixel_values(image, pixels),
        }
    }

    /// Flat indices of pixels of an image, and where they are at these times, `[times][pixels][3]`.
    pub(super) fn paths(
        &self,
        image: usize,
        pixels: &Pixels,
        times: &[usize],
    ) -> Result<(Vec<u32>, Vec<f32>), OmnixError> {
        let field = match self {
            Self::One(field) => field,
            Self::Film(film) => return film.paths(image, pixels, times, &mut stop::answer),
        };
        let (mut positions, mut flat) = (Vec::new(), None);
        // A run of neighbouring times is one evaluation.
        for run in times.chunk_by(|a, b| a + 1 == *b) {
            let range = run[0]..run[run.len() - 1] + 1;
            let paths = field.paths(&Query::new(image, pixels.clone(), range))?;
            positions.extend(paths.positions);
            flat = paths.pixels;
        }
        Ok((flat.unwrap_or_else(|| (0..field.shape().pixels() as u32).collect()), positions))
    }
}
