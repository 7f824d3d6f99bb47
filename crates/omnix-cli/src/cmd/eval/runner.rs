//! A network on a device, as evaluations see it: one session for clips of one shape.

use omnix::io::preprocess::normalise;
use omnix::{Engine, Event, Field, Pixels, Query, Request, RunPlan, Session, Weights};
use omnix_eval::EvalError;
use omnix_eval::run::{Clip, Network, Seen};

use crate::args::DeviceArgs;
use crate::error::CliError;
use crate::prepare;

/// What a session was planned for: the images' times, (video, frame), and their size.
type Shape = (Vec<(u32, u32)>, [u32; 2]);

/// A network, its session for clips of one shape, and what it says of the clip that it saw last.
pub(super) struct Runner {
    name: String,
    size: Option<(u32, u32)>,
    engine: Engine,
    weights: Weights,
    ready: Option<(Shape, Session)>,
    field: Option<Box<Field>>,
}

impl Runner {
    /// Finds the weights and opens a device. `cameras`: whether the network's cameras are judged, which not every network makes.
    pub(super) fn open(
        weights: &str,
        size: Option<(u32, u32)>,
        device: &DeviceArgs,
        cameras: bool,
    ) -> Result<Self, CliError> {
        let found = Weights::find(weights)?;
        let config = found.network().config();
        if cameras && !config.makes_cameras() {
            return Err(CliError::Usage(format!(
                "{} makes no cameras, which are judged here: take an any-view network, or judge depth by `omnix eval depth`",
                config.name
            )));
        }
        let engine = device.open()?;
        Ok(Self { name: weights.to_owned(), size, engine, weights: found, ready: None, field: None })
    }

    /// Depth and cameras of a clip; the field of a network that has one is kept.
    pub(super) fn look(&mut self, clip: &Clip) -> Result<Seen, CliError> {
        let pixels = clip.size[0] as usize * clip.size[1] as usize;
        // Before the next run, which may need its memory.
        self.field = None;
        let session = self.session(clip)?;
        let mut plane = vec![0.0; 3 * pixels];
        for (image, picture) in clip.pictures.iter().enumerate() {
            normalise(picture, &mut plane);
            session.set_image(image, &plane)?;
        }
        let (mut depth, mut cameras, mut field) = (vec![0.0; clip.pictures.len() * pixels], Vec::new(), None);
        session.run(&mut |event| {
            match event {
                Event::Frame(frame) => {
                    depth[frame.index * pixels..(frame.index + 1) * pixels].copy_from_slice(&frame.depth);
                    cameras.extend(frame.camera);
                }
                Event::Field(made) => field = Some(made),
                _ => {}
            }
            Ok(())
        })?;
        self.field = field;
        Ok(Seen { depth, cameras })
    }

    /// The field of the clip seen last.
    pub(super) fn field(&self) -> Option<&Field> {
        self.field.as_deref()
    }

    /// The session for clips of this shape and these times.
    fn session(&mut self, clip: &Clip) -> Result<&mut Session, CliError> {
        let key = (clip.times.clone(), clip.size);
        let ready = match self.ready.take() {
            Some(ready) if ready.0 == key => ready,
            _ => {
                let [width, height] = clip.size.map(|side| side as usize);
                let request = Request::new(clip.pictures.len(), height, width);
                let request = request.times(clip.times.clone()).motion(self.has_paths());
                let plan = RunPlan::new(&self.weights, &request, self.engine.caps())?;
                (key, Session::new(&self.engine, &self.weights, plan, &mut omnix::quiet())?)
            }
        };
        Ok(&mut self.ready.insert(ready).1)
    }
}

/// The evaluation ends with the error that the program would end with.
fn run_error(error: CliError) -> EvalError {
    EvalError::Run(Box::new(error))
}

impl Network for Runner {
    fn name(&self) -> String {
        self.name.clone()
    }

    fn size(&self, [width, height]: [u32; 2]) -> [u32; 2] {
        let (width, height) = self.size.unwrap_or_else(|| prepare::usual_size(&self.weights, (width, height)));
        [width, height]
    }

    fn has_paths(&self) -> bool {
        self.weights.network().config().trajectory.is_some()
    }

    fn see(&mut self, clip: &Clip) -> Result<Seen, EvalError> {
        self.look(clip).map_err(run_error)
    }

    fn paths(&mut self, image: usize, pixels: Option<&[[u32; 2]]>) -> Result<Vec<[f32; 3]>, EvalError> {
        let times = self.ready.as_ref().map_or(0, |((times, _), _)| times.len());
        let pixels = pixels.map_or(Pixels::All, |list| Pixels::List(list.to_vec()));
        let Some(field) = &self.field else { return Ok(Vec::new()) };
        let found = field.paths(&Query::new(image, pixels, 0..times)).map_err(|error| run_error(error.into()))?;
        Ok(found.positions.as_chunks::<3>().0.to_vec())
    }
}
