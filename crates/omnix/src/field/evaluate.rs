//! Trajectories from a field: of one image, of the pixels and times that are asked for, and no others.
//!
//! Work goes in chunks of target times and, where even one time of all pixels is too much, of pixels. A number depends on
//! neither, bit for bit, so what is evaluated at once, streamed, or from a saved field is the same.

use std::ops::Range;

use omnix_graph::ops::Motion;
use omnix_graph::{Bindings, Executable, Graph, Plan, PlanOptions, WeightStore};
use omnix_kernels::{BufferSlice, Caps, readback};
use omnix_model::TrajectorySpec;

use super::Field;
use super::maps::Maps;
use super::shape::{FieldShape, PARTS, Part};
use crate::error::OmnixError;

/// How much is evaluated at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Chunk {
    /// Pixels.
    pub pixels: usize,
    /// Target times.
    pub times: usize,
}

/// Which pixels of an image.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Pixels {
    /// All, row by row.
    All,
    /// These columns and rows, in this order.
    List(Vec<[u32; 2]>),
    /// Those where the mask (one value per pixel, row by row) is true, row by row.
    Mask(Vec<bool>),
    /// Every n-th column and row, from the first.
    Stride(usize),
}

/// What is to be evaluated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Query {
    /// The source image.
    pub image: usize,
    /// Its pixels.
    pub pixels: Pixels,
    /// Target times.
    pub times: Range<usize>,
    /// At most so much at a time; `None` lets the budget decide.
    pub chunk: Option<Chunk>,
}

impl Query {
    /// Pixels of an image at these times.
    #[must_use]
    pub fn new(image: usize, pixels: Pixels, times: Range<usize>) -> Self {
        Self { image, pixels, times, chunk: None }
    }
}

/// Evaluated trajectories.
#[derive(Clone, Debug, PartialEq)]
pub struct Paths {
    /// The target times.
    pub times: Range<usize>,
    /// Flat indices (row · width + column) of the pixels; `None` for all of them.
    pub pixels: Option<Vec<u32>>,
    /// `[times][pixels][3]`: world positions in the network's scale.
    pub positions: Vec<f32>,
    /// `[pixels]`: motion score θ.
    pub theta: Vec<f32>,
}

/// A piece of trajectories, as they stream.
#[derive(Clone, Copy, Debug)]
pub struct PathPiece<'a> {
    /// The first of its target times.
    pub first_time: usize,
    /// Number of its target times.
    pub times: usize,
    /// The first of its pixels, counted among those asked for.
    pub first_pixel: usize,
    /// `[times][pixels of the piece][3]`.
    pub positions: &'a [f32],
    /// `[pixels of the piece]`.
    pub theta: &'a [f32],
}

/// Trajectories on the device: f32, row-major, storage buffers that can also be copied from.
#[derive(Clone, Debug)]
pub struct ResidentPaths {
    /// `[times, pixels, 3]`.
    pub positions: BufferSlice,
    /// `[pixels]`.
    pub theta: BufferSlice,
}

impl Pixels {
    /// Flat indices of the pixels, `None` for all.
    pub(super) fn resolve(&self, shape: &FieldShape) -> Result<Option<Vec<u32>>, OmnixError> {
        let (width, height) = (shape.width, shape.height);
        let wrong = |reason: String| OmnixError::Query { reason };
        match self {
            Self::All => Ok(None),
            Self::List(list) => {
                if let Some([x, y]) = list.iter().find(|[x, y]| *x as usize >= width || *y as usize >= height) {
                    let (right, bottom) = (width - 1, height - 1);
                    return Err(wrong(format!(
                        "pixel {x},{y} lies outside the image: columns go from 0 to {right}, rows from 0 to {bottom}"
                    )));
                }
                Ok(Some(list.iter().map(|[x, y]| y * width as u32 + x).collect()))
            }
            Self::Mask(mask) if mask.len() != width * height => {
                let pixels = mask.len();
                Err(wrong(format!("a mask of {pixels} pixels: images of this field have {width}x{height}")))
            }
            Self::Mask(mask) => Ok(Some((0..).zip(mask).filter(|(_, on)| **on).map(|(i, _)| i).collect())),
            Self::Stride(0) => Err(wrong("a stride of 0: 1 is every pixel".to_owned())),
            Self::Stride(1) => Ok(None),
            Self::Stride(step) => {
                let row = |y: usize| (0..width).step_by(*step).map(move |x| (y * width + x) as u32);
                Ok(Some((0..height).step_by(*step).flat_map(row).collect()))
            }
        }
    }
}

impl Field {
    /// Evaluates trajectories into memory of the host.
    ///
    /// # Errors
    /// [`OmnixError::Query`] for an image, pixel or time that is not there; failures of the device or of reading a file.
    pub fn paths(&self, query: &Query) -> Result<Paths, OmnixError> {
        let pixels = self.check(query)?;
        let count = pixels.as_ref().map_or(self.shape().pixels(), Vec::len);
        let (mut positions, mut theta) = (vec![0.0; 3 * count * query.times.len()], vec![0.0; count]);
        self.stream(query, &mut |piece| {
            let n = piece.theta.len();
            for time in 0..piece.times {
                let to = 3 * ((piece.first_time - query.times.start + time) * count + piece.first_pixel);
                positions[to..to + 3 * n].copy_from_slice(&piece.positions[3 * time * n..3 * (time + 1) * n]);
            }
            theta[piece.first_pixel..piece.first_pixel + n].copy_from_slice(piece.theta);
            Ok(())
        })?;
        Ok(Paths { times: query.times.clone(), pixels, positions, theta })
    }

    /// Evaluates trajectories piece by piece: target times ascending, for each the pixels in order. A piece has all pixels
    /// asked for unless even one time of them is too much.
    ///
    /// # Errors
    /// As [`Field::paths`], or of `each`.
    pub fn stream(
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
        let evaluation = self.evaluation(query, pixels.as_deref(), chunk, inputs)?;
        for first_time in query.times.clone().step_by(chunk.times) {
            let times = chunk.times.min(query.times.end - first_time);
            for first_pixel in (0..count).step_by(chunk.pixels) {
                let n = chunk.pixels.min(count - first_pixel);
                if let Some(pixels) = &pixels {
                    evaluation.list(pixels, first_pixel..first_pixel + n, chunk.pixels)?;
                }
                let [positions, theta] = evaluation.run(query, first_time)?;
                let positions = readback::read::<f32>(self.gpu(), &positions)?;
                let theta = readback::read::<f32>(self.gpu(), &theta)?;
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
        Ok(())
    }

    /// Evaluates trajectories in one piece that stays on the device.
    ///
    /// # Errors
    /// As [`Field::paths`]; also for no pixels or no times.
    pub fn resident_paths(&self, query: &Query) -> Result<ResidentPaths, OmnixError> {
        let pixels = self.check(query)?;
        let count = pixels.as_ref().map_or(self.shape().pixels(), Vec::len);
        if count == 0 || query.times.is_empty() {
            return Err(OmnixError::Query { reason: "no pixels or no times are asked for".to_owned() });
        }
        let inputs = self.inputs(query, pixels.as_deref());
        let chunk = Chunk { pixels: count, times: query.times.len() };
        let evaluation = self.evaluation(query, pixels.as_deref(), chunk, inputs)?;
        if let Some(pixels) = &pixels {
            evaluation.list(pixels, 0..count, count)?;
        }
        let [positions, theta] = evaluation.run(query, query.times.start)?;
        Ok(ResidentPaths { positions, theta })
    }

    /// Computes and keeps the scores of an image's pixels.
    pub(crate) fn score(&mut self, image: usize) -> Result<(), OmnixError> {
        let paths = self.paths(&Query::new(image, Pixels::All, image..image + 1))?;
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

    fn evaluation(
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
                exec.write(Part::Mask.name(), &self.store.numbers(image, Part::Mask)?)?;
                let mut rows = Vec::with_capacity(ROWS.len());
                for part in ROWS {
                    rows.push((part, self.store.rows(image, part, pixels)?));
                }
                Ok(Evaluation { exec, rows })
            }
            _ => {
                let parts = PARTS.into_iter().zip(self.image(image)?);
                let bindings: Bindings = parts.map(|(part, slice)| (part.name().to_owned(), slice)).collect();
                Ok(Evaluation { exec: made(&bindings)?, rows: Vec::new() })
            }
        }
    }
}

/// Fewer pixels than an image's pixels divided by this are read row by row.
const FEW: usize = 8;

/// The parts that have a row for each pixel.
const ROWS: [Part; 3] = [Part::Offsets, Part::Weights, Part::Points];

/// What an evaluation is given of its image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Inputs {
    /// All of it; listed pixels are gathered on the device.
    Whole,
    /// Rows of the listed pixels, and the field at the `times` target times asked for and at the image's own.
    Rows { times: usize },
}

/// One image's trajectories at a fixed number of pixels and times.
struct Evaluation {
    exec: Executable,
    /// Of [`Inputs::Rows`]: rows of all listed pixels; those of a chunk go to the device.
    rows: Vec<(Part, Vec<f32>)>,
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
    fn run(&self, query: &Query, first: usize) -> Result<[BufferSlice; 2], OmnixError> {
        let when = if self.rows.is_empty() {
            [query.image, first]
        } else {
            // The own time is behind those asked for.
            [query.times.len(), first - query.times.start]
        };
        self.exec.write_indices("when", &when.map(|time| time as u32))?;
        self.exec.run(&mut |_, _| std::ops::ControlFlow::Continue(()))?;
        Ok([self.exec.slice("trajectory")?, self.exec.slice("theta")?])
    }
}

fn plan(
    shape: &FieldShape,
    motion: Motion,
    caps: &Caps,
    inputs: Inputs,
    listed: Option<usize>,
    times: usize,
) -> Result<Plan, OmnixError> {
    let [rows, columns] = shape.grid;
    let (all_times, gathered) = match inputs {
        Inputs::Whole => (shape.images, false),
        Inputs::Rows { times } => (times + 1, true),
    };
    let spec = TrajectorySpec {
        grid: (rows, columns),
        levels: shape.levels,
        points: shape.points,
        all_times,
        times,
        pixels: listed,
        gathered,
        motion,
    };
    let mut graph = Graph::new();
    omnix_model::trajectory(&mut graph, &spec)?;
    Ok(Plan::new(&graph, caps, &PlanOptions::default())?)
}

/// What the bytes of an evaluation depend on.
struct Sizes<'a> {
    shape: &'a FieldShape,
    motion: Motion,
    caps: &'a Caps,
    inputs: Inputs,
    resident: bool,
}

/// Positions that are read back at a time, where no budget says less.
const PIECE: u64 = 256 << 20;

impl Sizes<'_> {
    /// Bytes of a chunk: the plan's own, less what is bound to the field where that is on the device, and the staging
    /// through which positions are read back.
    fn bytes(&self, chunk: Chunk, listed: bool) -> Result<u64, OmnixError> {
        let plan = plan(self.shape, self.motion, self.caps, self.inputs, listed.then_some(chunk.pixels), chunk.times)?;
        let bound = if self.resident { self.shape.image_bytes() } else { 0 };
        Ok(plan.working_bytes().saturating_sub(bound) + (chunk.pixels * chunk.times * 12) as u64)
    }

    /// The largest chunk up to `whole` that fits, and its bytes: fewer times first, then fewer pixels.
    fn fit(&self, whole: Chunk, listed: bool, room: Option<u64>) -> Result<(Chunk, u64), OmnixError> {
        let mut chunk = whole;
        while chunk.times > 1 && (chunk.pixels * chunk.times * 12) as u64 > PIECE {
            chunk.times = chunk.times.div_ceil(2);
        }
        loop {
            let listed = listed || chunk.pixels < whole.pixels;
            let bytes = self.bytes(chunk, listed)?;
            if room.is_none_or(|room| bytes <= room) || chunk.pixels <= LEAST {
                return Ok((chunk, bytes));
            }
            match chunk.times {
                1 => chunk.pixels = chunk.pixels.div_ceil(2).max(LEAST),
                _ => chunk.times = chunk.times.div_ceil(2),
            }
        }
    }
}

/// Fewer pixels than this at a time save no memory worth it.
const LEAST: usize = 1024;

/// The chunk in which all pixels of an image are evaluated at all times within `room`, and its bytes.
pub(crate) fn fit(
    shape: &FieldShape,
    motion: Motion,
    caps: &Caps,
    resident: bool,
    room: Option<u64>,
) -> Result<(Chunk, u64), OmnixError> {
    let whole = Chunk { pixels: shape.pixels(), times: shape.images };
    Sizes { shape, motion, caps, inputs: Inputs::Whole, resident }.fit(whole, false, room)
}

/// Bytes of the smallest chunk.
pub(crate) fn least(shape: &FieldShape, motion: Motion, caps: &Caps, resident: bool) -> Result<u64, OmnixError> {
    Ok(fit(shape, motion, caps, resident, Some(0))?.1)
}
