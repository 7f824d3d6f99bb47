//! Trajectories from a field: of one image, of the pixels and times that are asked for, and no others.
//!
//! Work goes in chunks of target times and, where even one time of all pixels is too much, of pixels. A number depends on
//! neither, bit for bit, so what is evaluated at once, streamed, or from a saved field is the same.

use std::ops::{ControlFlow, Range};

use omnix_graph::{Bindings, Executable, WeightStore};
use omnix_kernels::BufferSlice;
use omnix_kernels::readback::read_async;

use super::Field;
use super::chunk::{Chunk, Inputs, Sizes, plan};
use super::maps::Maps;
use super::query::{PathPiece, Paths, Pixels, Query, ResidentPaths};
use super::shape::{PARTS, Part};
use super::store::Resident;
use crate::error::OmnixError;

impl Field {
    /// Evaluates trajectories into memory of the host.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image, pixel or time that is not there; failures of the device or of reading a file.
    pub async fn paths_async(&self, query: &Query) -> Result<Paths, OmnixError> {
        let pixels = self.check(query)?;
        let count = pixels.as_ref().map_or(self.shape().pixels(), Vec::len);
        let (mut positions, mut theta) = (vec![0.0; 3 * count * query.times.len()], vec![0.0; count]);
        self.stream_async(query, &mut |piece| {
            let n = piece.theta.len();
            for time in 0..piece.times {
                let to = 3 * ((piece.first_time - query.times.start + time) * count + piece.first_pixel);
                positions[to..to + 3 * n].copy_from_slice(&piece.positions[3 * time * n..3 * (time + 1) * n]);
            }
            theta[piece.first_pixel..piece.first_pixel + n].copy_from_slice(piece.theta);
            Ok(())
        })
        .await?;
        Ok(Paths { times: query.times.clone(), pixels, positions, theta })
    }

    /// Evaluates trajectories piece by piece: target times ascending, for each the pixels in order. A piece has all pixels
    /// asked for unless even one time of them is too much.
    ///
    /// # Errors
    /// As [`Field::paths_async`], or of `each`.
    pub async fn stream_async(
        &self,
        query: &Query,
        each: &mut dyn FnMut(&PathPiece<'_>) -> Result<(), OmnixError>,
    ) -> Result<(), OmnixError> {
        let mut pixels = self.check(query)?;
        let count = pixels.as_ref().map_or(self.shape().pixels(), Vec::len);
        if count == 0 || query.times.is_empty() {
            return Ok(());
        }
        let inputs = self.inputs(query, pixels.as_deref());
        let chunk = self.chunk(query, count, inputs, pixels.is_some())?;
        if chunk.pixels < count && pixels.is_none() {
            pixels = Some((0..count as u32).collect());
        }
        let evaluation = self.evaluation(query, pixels.as_deref(), chunk, inputs).await?;
        for first_time in query.times.clone().step_by(chunk.times) {
            let times = chunk.times.min(query.times.end - first_time);
            for first_pixel in (0..count).step_by(chunk.pixels) {
                let n = chunk.pixels.min(count - first_pixel);
                if let Some(pixels) = &pixels {
                    evaluation.list(pixels, first_pixel..first_pixel + n, chunk.pixels)?;
                }
                let [positions, theta] = evaluation.run(query, first_time).await?;
                let positions = read_async::<f32>(self.gpu(), &positions).await?;
                let theta = read_async::<f32>(self.gpu(), &theta).await?;
                // A shorter last chunk runs at the same size: its tail is left aside.
                let kept: Vec<f32> = if n == chunk.pixels {
                    positions[..3 * times * n].to_vec()
                } else {
                    let time = |t: usize| &positions[3 * t * chunk.pixels..][..3 * n];
                    (0..times).flat_map(time).copied().collect()
                };
                each(&PathPiece { first_time, times, first_pixel, positions: &kept, theta: &theta[..n] })?;
            }
        }
        self.release(query.image, evaluation);
        Ok(())
    }

    /// Evaluates trajectories in one piece that stays on the device.
    ///
    /// # Errors
    /// As [`Field::paths_async`]; also for no pixels or no times.
    pub async fn resident_paths_async(&self, query: &Query) -> Result<ResidentPaths, OmnixError> {
        let pixels = self.check(query)?;
        let count = pixels.as_ref().map_or(self.shape().pixels(), Vec::len);
        if count == 0 || query.times.is_empty() {
            return Err(OmnixError::Query { reason: "no pixels or no times are asked for".to_owned() });
        }
        let inputs = self.inputs(query, pixels.as_deref());
        let chunk = Chunk { pixels: count, times: query.times.len() };
        let evaluation = self.evaluation(query, pixels.as_deref(), chunk, inputs).await?;
        if let Some(pixels) = &pixels {
            evaluation.list(pixels, 0..count, count)?;
        }
        let [positions, theta] = evaluation.run(query, query.times.start).await?;
        self.release(query.image, evaluation);
        Ok(ResidentPaths { positions, theta })
    }

    /// Computes and keeps the scores of an image's pixels.
    pub(crate) async fn score(&mut self, image: usize) -> Result<(), OmnixError> {
        let paths = self.paths_async(&Query::new(image, Pixels::All, image..image + 1)).await?;
        if let Maps::Memory(maps) = &mut self.maps {
            maps[image].theta = paths.theta;
        }
        Ok(())
    }

    /// Checks image, times and pixels; flat indices of the pixels, `None` for all.
    fn check(&self, query: &Query) -> Result<Option<Vec<u32>>, OmnixError> {
        let images = self.shape().images;
        self.check_image(query.image)?;
        if query.times.start > query.times.end || query.times.end > images {
            let Range { start, end } = query.times;
            let reason = format!("times {start}..{end}: this field has times 0..{images}");
            return Err(OmnixError::Query { reason });
        }
        query.pixels.resolve(self.shape())
    }

    /// What the evaluation is given: of a file, a few pixels' rows instead of the whole image.
    fn inputs(&self, query: &Query, pixels: Option<&[u32]>) -> Inputs {
        match pixels {
            Some(list) if !self.on_device() && list.len() < self.shape().pixels() / FEW => {
                Inputs::Rows { times: query.times.len() }
            }
            _ => Inputs::Whole,
        }
    }

    fn chunk(&self, query: &Query, count: usize, inputs: Inputs, listed: bool) -> Result<Chunk, OmnixError> {
        let most = query.chunk.unwrap_or(Chunk { pixels: count, times: query.times.len() });
        let whole = Chunk { pixels: most.pixels.clamp(1, count), times: most.times.clamp(1, query.times.len()) };
        let (shape, motion, caps) = (self.shape(), self.motion(), &self.gpu().caps);
        let sizes = Sizes { shape, motion, caps, inputs, resident: self.on_device() };
        Ok(sizes.fit(whole, listed, self.room())?.0)
    }

    async fn evaluation(
        &self,
        query: &Query,
        pixels: Option<&[u32]>,
        chunk: Chunk,
        inputs: Inputs,
    ) -> Result<Evaluation, OmnixError> {
        let (image, listed) = (query.image, pixels.is_some().then_some(chunk.pixels));
        let plan = plan(self.shape(), self.motion(), &self.gpu().caps, inputs, listed, chunk.times)?;
        let made = |bindings| Executable::new(self.gpu(), plan, &WeightStore::default(), bindings);
        match (inputs, pixels) {
            (Inputs::Rows { .. }, Some(pixels)) => {
                let exec = made(&Bindings::default())?;
                exec.write(Part::Field.name(), &self.store.times(image, &query.times)?)?;
                exec.write(Part::Mask.name(), &self.store.numbers(image, Part::Mask).await?)?;
                let mut rows = Vec::with_capacity(ROWS.len());
                for part in ROWS {
                    rows.push((part, self.store.rows(image, part, pixels)?));
                }
                Ok(Evaluation { exec, rows, whole: None })
            }
            _ => {
                let whole = self.store.image(image).await?;
                let parts = PARTS.into_iter().zip(&whole);
                let bindings: Bindings = parts.map(|(part, slice)| (part.name().to_owned(), slice.clone())).collect();
                Ok(Evaluation { exec: made(&bindings)?, rows: Vec::new(), whole: Some(whole) })
            }
        }
    }

    /// Gives back what an evaluation took of the store; one that failed takes it along.
    fn release(&self, image: usize, evaluation: Evaluation) {
        if let Some(whole) = evaluation.whole {
            self.store.release(image, whole);
        }
    }
}

/// Fewer pixels than an image's pixels divided by this are read row by row.
const FEW: usize = 8;

/// The parts that have a row for each pixel.
const ROWS: [Part; 3] = [Part::Offsets, Part::Weights, Part::Points];

/// One image's trajectories at a fixed number of pixels and times.
struct Evaluation {
    exec: Executable,
    /// Of [`Inputs::Rows`]: rows of all listed pixels; those of a chunk go to the device.
    rows: Vec<(Part, Vec<f32>)>,
    /// Of [`Inputs::Whole`]: the image's parts.
    whole: Option<Resident>,
}

impl Evaluation {
    /// Sets the pixels to a range of those listed; fewer than planned for are filled up with the last.
    fn list(&self, pixels: &[u32], range: Range<usize>, count: usize) -> Result<(), OmnixError> {
        let padded = |numbers: usize| {
            range
                .clone()
                .chain(std::iter::repeat_n(range.end - 1, count - range.len()))
                .flat_map(move |row| row * numbers..(row + 1) * numbers)
        };
        for (part, all) in &self.rows {
            let chunk: Vec<f32> = padded(all.len() / pixels.len()).map(|at| all[at]).collect();
            self.exec.write(part.name(), &chunk)?;
        }
        let listed: Vec<u32> = padded(1).map(|at| pixels[at]).collect();
        Ok(self.exec.write_indices("pixels", &listed)?)
    }

    /// Positions and scores from time `first` on.
    async fn run(&self, query: &Query, first: usize) -> Result<[BufferSlice; 2], OmnixError> {
        let when = if self.rows.is_empty() {
            [query.image, first]
        } else {
            // The own time is behind those asked for.
            [query.times.len(), first - query.times.start]
        };
        self.exec.write_indices("when", &when.map(|time| time as u32))?;
        self.exec.start().finish(&mut |_, _| ControlFlow::Continue(())).await?;
        Ok([self.exec.slice("trajectory")?, self.exec.slice("theta")?])
    }
}
