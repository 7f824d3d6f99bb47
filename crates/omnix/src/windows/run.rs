//! The windows of a film, one after the other, each into its file; those that are there already are not computed again.

use std::path::Path;
use std::sync::Arc;

use omnix_geometry::{Camera, RayMaps, cameras_from_rays, sample_table};
use omnix_graph::ops::Gate;

use super::follow::WindowField;
use super::layout::{Layout, Window};
use super::stored::{StoredWindow, WindowImage, field_path, is_field_of, store, window_path};
use crate::engine::Engine;
use crate::error::OmnixError;
use crate::event::{Event, FrameGeometry, Listener, WindowBegun};
use crate::field::{Field, FieldPrecision, Pixels, Query, motion_of};
use crate::plan::RunPlan;
use crate::request::Request;
use crate::session::Session;
use crate::weights::Weights;

/// Gives the normalised numbers of an image of the film, `[3, height, width]`.
pub type Pictures<'a> = &'a mut dyn FnMut(usize, &mut [f32]) -> Result<(), OmnixError>;

/// Motion scores of a network without a threshold count as still below this.
const BLENDED: f32 = 0.5;

/// A film that is reconstructed window by window.
#[derive(Clone, Copy, Debug)]
pub struct Windows<'a> {
    /// The device.
    pub engine: &'a Engine,
    /// The network.
    pub weights: &'a Weights,
    /// What is wanted of the whole film: its number of images and their times. With `motion`, joins leave out what moves.
    pub request: &'a Request,
    /// Its windows.
    pub layout: &'a Layout,
    /// Where their files go.
    pub folder: &'a Path,
    /// Whether the windows' fields are kept, for [`super::Follow`] and [`super::FilmField`].
    pub fields: bool,
}

/// What is asked of a window of a film: `film`'s settings for the window's images, with times from the first frame on.
///
/// # Errors
/// Known cameras, a known distance, or a reference view by number: none of them has a meaning in a window.
pub fn window_request(film: &Request, window: &Window) -> Result<Request, OmnixError> {
    let wrong = |reason: &str| Err(OmnixError::Request { reason: reason.to_owned() });
    if film.distance.is_some() {
        return wrong("a known distance and windows do not go together: reconstruct fewer images at once");
    }
    if film.cameras.is_some() {
        return wrong("known cameras and windows do not go together: reconstruct fewer images at once");
    }
    if matches!(film.reference, Some(omnix_model::backbone::ReferenceChoice::Forced(_))) {
        return wrong("a reference view by its number does not go together with windows: name a rule");
    }
    let times = &film.image_times()[window.images.clone()];
    let first = |video: u32| times.iter().filter(|(of, _)| *of == video).map(|(_, frame)| *frame).min().unwrap_or(0);
    let own = times.iter().map(|&(video, frame)| (video, frame - first(video))).collect();
    let mut request = film.clone().images(window.images.len()).times(own);
    request.masks = film.masks.as_ref().map(|masks| Arc::new(masks.part(window.images.clone())));
    Ok(request)
}

/// The motion score up to which a pixel counts as still; none where the network says nothing of motion.
pub fn still_up_to(weights: &Weights) -> Option<f32> {
    match motion_of(weights).ok()?.gate {
        Gate::None => None,
        Gate::Hard(threshold) => Some(threshold),
        Gate::Blend => Some(BLENDED),
    }
}

impl Windows<'_> {
    /// Computes the windows whose files are not there. `listener` is told of every window, and of progress within those that are computed.
    ///
    /// # Errors
    /// As [`Session::run`], or of `pictures`; a failure of writing. What was finished by then stays.
    pub fn run(&self, pictures: Pictures<'_>, listener: Listener<'_>) -> Result<(), OmnixError> {
        let size = [self.request.height, self.request.width];
        let mut numbers = vec![0.0; 3 * size[0] * size[1]];
        let mut session: Option<Session> = None;
        let windows = self.layout.windows();
        for (index, window) in windows.iter().enumerate() {
            let request = window_request(self.request, window)?;
            let path = window_path(self.folder, index);
            let mut key = self.key(&request);
            for image in window.images.clone() {
                pictures(image, &mut numbers)?;
                key.update(bytemuck::cast_slice(&numbers));
            }
            let key = format!("blake3:{}", key.finalize().to_hex());
            let kept = self.fields.then(|| field_path(self.folder, index));
            let found = StoredWindow::open(&path, size).is_ok_and(|stored| stored.key() == key)
                && kept.as_ref().is_none_or(|path| is_field_of(path, &key));
            let images = window.images.clone();
            listener(Event::Window(WindowBegun { index, windows: windows.len(), images, found }))?;
            if found {
                continue;
            }
            let made = match session.take() {
                Some(made) if serves(made.plan(), &request) => made,
                before => {
                    // Its memory goes back first.
                    drop(before);
                    let plan = RunPlan::new(self.weights, &request, self.engine.caps())?;
                    Session::new(self.engine, self.weights, plan, listener)?
                }
            };
            let made = session.insert(made);
            for (place, image) in window.images.clone().enumerate() {
                pictures(image, &mut numbers)?;
                made.set_image(place, &numbers)?;
            }
            // The window's own file comes last: where it is, so is the field.
            let kept = kept.as_deref().map(|path| (path, key.as_str()));
            store(&path, &key, size, &compute(made, kept, listener)?)?;
        }
        Ok(())
    }

    /// Of all that a window's numbers depend on but its pictures.
    fn key(&self, request: &Request) -> blake3::Hasher {
        let device = self.engine.info();
        let mut key = blake3::Hasher::new();
        let Request { images, height, width, times, reference, rays, motion, storage, .. } = request;
        let facts = format!(
            "{} {} {} {} {} {} {images} {height} {width} {times:?} {reference:?} {rays} {motion} {storage:?}",
            env!("CARGO_PKG_VERSION"),
            self.fields,
            self.weights.checkpoint().digest(),
            device.name,
            device.backend,
            device.driver,
        );
        key.update(facts.as_bytes());
        key.update(request.masks.as_ref().map(|masks| masks.digest()).unwrap_or_default().as_bytes());
        key
    }
}

/// Whether a session of this plan can run the request.
fn serves(plan: &RunPlan, request: &Request) -> bool {
    plan.request.images == request.images && plan.request.times == request.times && plan.request.masks == request.masks
}

impl WindowField for Field {
    fn theta(&mut self, image: usize) -> Result<Vec<f32>, OmnixError> {
        Ok(Self::theta(self, image)?.into_owned())
    }

    fn confidence(&mut self, image: usize) -> Result<Vec<f32>, OmnixError> {
        Ok(Self::confidence(self, image)?.into_owned())
    }

    fn moves(&self, theta: f32) -> bool {
        Self::moves(self, theta)
    }

    fn points(&mut self, image: usize) -> Result<Vec<f32>, OmnixError> {
        Self::points(self, image)
    }

    fn paths(&mut self, image: usize, pixels: &[[u32; 2]]) -> Result<Vec<f32>, OmnixError> {
        let times = 0..self.shape().images;
        Ok(Self::paths(self, &Query::new(image, Pixels::List(pixels.to_vec()), times))?.positions)
    }

    fn camera(&self, image: usize) -> Camera {
        self.images()[image].camera
    }
}

/// One window's images; its field into a file, with the window's digest.
fn compute(
    session: &mut Session,
    kept: Option<(&Path, &str)>,
    listener: Listener<'_>,
) -> Result<Vec<WindowImage>, OmnixError> {
    let request = session.plan().request.clone();
    let (rows, columns) = request.grid();
    let rays_size = [8 * rows, 8 * columns];
    let table = request.rays.then(|| sample_table(rays_size[0] * rays_size[1]));
    let mut images = Vec::with_capacity(request.images);
    session.run(&mut |event| {
        match event {
            Event::Frame(geometry) => {
                let FrameGeometry { depth, confidence, camera, rays, .. } = geometry;
                let (Some(confidence), Some(mut camera)) = (confidence, camera) else {
                    let reason = "windows are joined by confidence and cameras, which this network does not make";
                    return Err(OmnixError::Request { reason: reason.to_owned() });
                };
                if let (Some((rays, confidence)), Some(table)) = (&rays, &table) {
                    let maps = RayMaps { rays, confidence, size: rays_size };
                    let found = cameras_from_rays(&maps, [request.height as u32, request.width as u32], Some(table))?;
                    camera = found.first().map_or(camera, |found| found.camera);
                }
                images.push(WindowImage { depth, confidence, theta: None, camera });
                Ok(())
            }
            Event::Motion(motion) => {
                images[motion.index].theta = Some(motion.theta);
                Ok(())
            }
            // Its memory goes back at once.
            Event::Field(mut field) => kept.map_or(Ok(()), |(path, key)| {
                field.about_mut().window = Some(key.to_owned());
                field.images_mut().iter_mut().zip(&images).for_each(|(of, image)| of.camera = image.camera);
                field.save(path, FieldPrecision::F32).map(drop)
            }),
            other => listener(other),
        }
    })?;
    Ok(images)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_of_a_window_begin_at_nought() {
        let times = (0..6).map(|k| (0, k)).chain((0..6).map(|k| (1, k))).collect();
        let film = Request::new(12, 28, 28).times(times).motion(true);
        let of = |images| window_request(&film, &Window { images, shot: 0 }).unwrap();
        assert_eq!(of(2..5).times, Some(vec![(0, 0), (0, 1), (0, 2)]));
        assert_eq!(of(4..8).times, Some(vec![(0, 0), (0, 1), (1, 0), (1, 1)]));
        assert!(of(2..5).motion && of(2..5).images == 3);
        let forced = film.reference(omnix_model::backbone::ReferenceChoice::Forced(3));
        assert!(window_request(&forced, &Window { images: 0..4, shot: 0 }).is_err());
    }

    #[test]
    fn the_memory_of_a_film_is_that_of_a_window() {
        let weights = Weights::builtin().unwrap();
        let caps = omnix_kernels::Caps::lavapipe();
        let bytes = |images: usize| {
            let film = Request::new(images, 56, 84).motion(true).keep_weights(false);
            let layout = Layout::new(images, 12, 4, &[]).unwrap();
            let plan = |window: &Window| {
                let request = window_request(&film, window).unwrap();
                RunPlan::new(&weights, &request, &caps).unwrap().peak_bytes()
            };
            layout.windows().iter().take(2).chain(layout.windows().last()).map(plan).max().unwrap()
        };
        assert_eq!(bytes(60), bytes(300));
    }
}
