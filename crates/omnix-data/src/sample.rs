//! A sample: the images of one moving scene, and what is known about them.
//!
//! T images of one size, `[width, height]` = `[W, H]`. All lists are row-major, without gaps, in the order of the images.
//!
//! | what | layout | unknown |
//! |---|---|---|
//! | images | `[T][H][W][3]`, 8-bit red, green, blue | – |
//! | cameras | `[T]`, world-to-camera in OpenCV axes (x right, y down, z forward), intrinsics in pixels of the images | – |
//! | depth | `[T][H][W]`, z in the camera's frame, above 0 | NaN |
//! | moving | `[T][H][W]`, whether what the pixel shows moves at any time of the scene | [`Flag::Unknown`] |
//! | dense positions | `[T source][T time][H][W][3]`, where the point that the pixel of the source shows is at that time, world | all NaN |
//! | dense visibility | `[T source][T time][H][W]`, whether the image of that time shows that point | [`Flag::Unknown`] |
//! | positions of tracks | `[T time][N][3]`, world | all NaN |
//! | visibility of tracks | `[T time][N]` | [`Flag::Unknown`] |
//! | pixels of tracks | `[T time][N][2]`, column and row in the image of that time | NaN |
//!
//! The pixel of column j and row i has its centre at (j + 0.5, i + 0.5) of the image ([`PixelCentre::Half`]). A pixel is *valid*
//! where its depth is known; sky and whatever a data set marks as wrong have unknown depth. "Time t" is the moment at which image t
//! was taken. World coordinates are any frame that all cameras share; since cameras are f32, readers of data sets whose world is
//! large move its origin near the first camera before they round.

use std::ops::Range;

use bytemuck::NoUninit;
use omnix_geometry::{Camera, PixelCentre};

use crate::DataError;

/// Where the pixel of column j and row i of a sample lies in its image.
pub const PIXEL: PixelCentre = PixelCentre::Half;

/// Whether something is so, of one pixel or point.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, NoUninit)]
#[repr(u8)]
pub enum Flag {
    /// It is not.
    No = 0,
    /// It is.
    Yes = 1,
    /// Nobody knows.
    #[default]
    Unknown = 2,
}

impl From<bool> for Flag {
    fn from(yes: bool) -> Self {
        if yes { Self::Yes } else { Self::No }
    }
}

/// When an image was taken.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Time {
    /// Index of its video, as the network is told. A photograph is a video of one frame.
    pub video: u32,
    /// Index of its frame in that video, as the network is told.
    pub frame: u32,
    /// The moment in the scene: images of one moment show the same state of everything. Ascends with time.
    pub moment: u32,
    /// Seconds since the start of the recording, where the data set says it.
    pub seconds: Option<f64>,
}

/// The unit of all lengths of a sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Unit {
    /// Metres.
    Metre,
    /// One unit for all lengths of the scene, whose length in metres is not known.
    Scene,
    /// The mean distance of the points from the first camera (`spec/omnix.md` 11.1), as training wants it.
    MeanDistance,
}

/// Where each pixel's point is at each time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Dense {
    /// `[T source][T time][H][W]` positions in the world; unknown ones are three NaN.
    pub positions: Vec<[f32; 3]>,
    /// `[T source][T time][H][W]`, where known at all.
    pub visible: Option<Vec<Flag>>,
}

/// Where some points are at each time.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Tracks {
    /// Number of points.
    pub count: usize,
    /// `[T time][N]` positions in the world; unknown ones are three NaN.
    pub positions: Vec<[f32; 3]>,
    /// `[T time][N]`: whether the image of that time shows the point.
    pub visible: Vec<Flag>,
    /// `[T time][N]`: where in the image of that time the data set says that the point is, column and row, in whole pixels and
    /// fractions with the centre of the first pixel at (0.5, 0.5); none where it says nothing. NaN is unknown.
    pub pixels: Option<Vec<[f32; 2]>>,
}

/// What is known about motion.
#[derive(Debug, Clone, Default, PartialEq)]
pub enum Motion {
    /// Nothing.
    #[default]
    Unknown,
    /// All pixels' paths, as far as they are known.
    Dense(Dense),
    /// The paths of some points.
    Tracks(Tracks),
}

/// What a [`Sample`] is made of. Its layouts stand at the top of this file.
#[derive(Debug, Clone, PartialEq)]
pub struct SampleParts {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// `[T][H][W][3]`.
    pub images: Vec<u8>,
    /// One per image.
    pub times: Vec<Time>,
    /// One per image.
    pub cameras: Vec<Camera>,
    /// `[T][H][W]`, unknown is NaN; none where the data set has no depth.
    pub depth: Option<Vec<f32>>,
    /// `[T][H][W]`; none where the data set has no masks.
    pub moving: Option<Vec<Flag>>,
    /// Paths.
    pub motion: Motion,
    /// The unit of camera positions, depth and paths.
    pub unit: Unit,
}

/// The images of one moving scene with their ground truth, checked for shape and convention.
#[derive(Debug, Clone, PartialEq)]
pub struct Sample {
    parts: SampleParts,
}

impl Sample {
    /// A sample of these parts.
    ///
    /// # Errors
    /// No image, a list of the wrong length, a camera that is not finite, depth that is neither above 0 nor NaN, positions that are
    /// infinite or known in part.
    pub fn new(parts: SampleParts) -> Result<Self, DataError> {
        let sample = Self { parts };
        sample.check_lengths()?;
        sample.check_values()?;
        Ok(sample)
    }

    /// The parts, to change them and to make another sample of them.
    #[must_use]
    pub fn into_parts(self) -> SampleParts {
        self.parts
    }

    /// The parts.
    #[must_use]
    pub const fn parts(&self) -> &SampleParts {
        &self.parts
    }

    /// Number of images.
    #[must_use]
    pub fn count(&self) -> usize {
        self.parts.times.len()
    }

    /// Width and height in pixels.
    #[must_use]
    pub const fn size(&self) -> [u32; 2] {
        self.parts.size
    }

    /// Number of pixels of an image.
    #[must_use]
    pub const fn pixels(&self) -> usize {
        self.parts.size[0] as usize * self.parts.size[1] as usize
    }

    /// `[H][W][3]` of one image.
    #[must_use]
    pub fn image(&self, image: usize) -> &[u8] {
        let pixels = self.pixels();
        &self.parts.images[image * pixels * 3..(image + 1) * pixels * 3]
    }

    /// When each image was taken.
    #[must_use]
    pub fn times(&self) -> &[Time] {
        &self.parts.times
    }

    /// The cameras, world-to-camera.
    #[must_use]
    pub fn cameras(&self) -> &[Camera] {
        &self.parts.cameras
    }

    /// `[H][W]` of one image, unknown is NaN; none where the sample has no depth at all.
    #[must_use]
    pub fn depth(&self, image: usize) -> Option<&[f32]> {
        self.parts.depth.as_ref().map(|depth| &depth[self.map(image)])
    }

    /// `[H][W]` of one image: whether what the pixel shows moves.
    #[must_use]
    pub fn moving(&self, image: usize) -> Option<&[Flag]> {
        self.parts.moving.as_ref().map(|moving| &moving[self.map(image)])
    }

    /// What is known about motion.
    #[must_use]
    pub const fn motion(&self) -> &Motion {
        &self.parts.motion
    }

    /// The unit of all lengths.
    #[must_use]
    pub const fn unit(&self) -> Unit {
        self.parts.unit
    }

    /// `[H][W]`: where the points of the pixels of image `source` are when image `time` is taken; none without dense paths.
    #[must_use]
    pub fn positions(&self, source: usize, time: usize) -> Option<&[[f32; 3]]> {
        match &self.parts.motion {
            Motion::Dense(dense) => Some(&dense.positions[self.map(source * self.count() + time)]),
            Motion::Unknown | Motion::Tracks(_) => None,
        }
    }

    /// `[H][W]`: whether image `time` shows the points of the pixels of image `source`; none where that is not known.
    #[must_use]
    pub fn visible(&self, source: usize, time: usize) -> Option<&[Flag]> {
        match &self.parts.motion {
            Motion::Dense(Dense { visible: Some(visible), .. }) => {
                Some(&visible[self.map(source * self.count() + time)])
            }
            _ => None,
        }
    }

    /// Whether a pixel of an image is valid: its depth is known, or, in a sample without depth, its own place.
    #[must_use]
    pub fn valid(&self, image: usize, pixel: usize) -> bool {
        match self.depth(image) {
            Some(depth) => depth[pixel].is_finite(),
            None => self.positions(image, image).is_some_and(|own| own[pixel][0].is_finite()),
        }
    }

    /// Where the `index`-th map of H x W entries lies in a list of such maps.
    fn map(&self, index: usize) -> Range<usize> {
        let pixels = self.pixels();
        index * pixels..(index + 1) * pixels
    }

    fn check_lengths(&self) -> Result<(), DataError> {
        let SampleParts { size: [width, height], images, times, cameras, depth, moving, motion, .. } = &self.parts;
        let count = times.len();
        if count == 0 || *width == 0 || *height == 0 {
            return Err(DataError::Empty { images: count, width: *width, height: *height });
        }
        // A product that overflows is the length of no list.
        let times_pixels = |factor: usize| {
            (*width as usize)
                .checked_mul(*height as usize)
                .and_then(|pixels| pixels.checked_mul(factor))
                .unwrap_or(usize::MAX)
        };
        let expect = |what, layout, expected: usize, found: usize| {
            if expected == found { Ok(()) } else { Err(DataError::Length { what, layout, expected, found }) }
        };
        let square = count.saturating_mul(count);
        expect("images", "[T][H][W][3]", times_pixels(count.saturating_mul(3)), images.len())?;
        expect("cameras", "[T]", count, cameras.len())?;
        if let Some(depth) = depth {
            expect("depth", "[T][H][W]", times_pixels(count), depth.len())?;
        }
        if let Some(moving) = moving {
            expect("moving", "[T][H][W]", times_pixels(count), moving.len())?;
        }
        match motion {
            Motion::Unknown => Ok(()),
            Motion::Dense(Dense { positions, visible }) => {
                expect("positions", "[T][T][H][W]", times_pixels(square), positions.len())?;
                match visible {
                    Some(visible) => expect("visible", "[T][T][H][W]", times_pixels(square), visible.len()),
                    None => Ok(()),
                }
            }
            Motion::Tracks(Tracks { count: points, positions, visible, pixels }) => {
                let expected = count.saturating_mul(*points);
                expect("positions of tracks", "[T][N]", expected, positions.len())?;
                expect("visibility of tracks", "[T][N]", expected, visible.len())?;
                pixels.as_ref().map_or(Ok(()), |pixels| expect("pixels of tracks", "[T][N]", expected, pixels.len()))
            }
        }
    }

    fn check_values(&self) -> Result<(), DataError> {
        for (image, camera) in self.parts.cameras.iter().enumerate() {
            check_camera(camera).map_err(|reason| DataError::Camera { image, reason })?;
        }
        let bad = |value: &f32| *value <= 0.0 || value.is_infinite();
        if let Some(depth) = &self.parts.depth
            && let Some(index) = depth.iter().position(bad)
        {
            let rule = "known depth is finite and above 0, unknown depth is NaN";
            return Err(DataError::Value { what: "depth", index, value: f64::from(depth[index]), rule });
        }
        let (what, positions) = match &self.parts.motion {
            Motion::Unknown => return Ok(()),
            Motion::Dense(dense) => ("positions", &dense.positions),
            Motion::Tracks(tracks) => ("positions of tracks", &tracks.positions),
        };
        let whole = |p: &[f32; 3]| p.iter().all(|v| v.is_finite()) || p.iter().all(|v| v.is_nan());
        match positions.iter().position(|p| !whole(p)) {
            None => Ok(()),
            Some(index) => {
                let odd = positions[index].into_iter().find(|v| !v.is_finite()).unwrap_or(f32::NAN);
                let rule = "a known position is three finite numbers, an unknown one three NaN";
                Err(DataError::Value { what, index, value: f64::from(odd), rule })
            }
        }
    }
}

/// Whether this is a pinhole camera with finite numbers. Whether its rotation is one is measured by the check of data sets, which has
/// to be able to read a faulty one.
fn check_camera(camera: &Camera) -> Result<(), &'static str> {
    let Camera { extrinsics, intrinsics } = camera;
    if !extrinsics.iter().flatten().chain(intrinsics.iter().flatten()).all(|v| v.is_finite()) {
        return Err("it has a NaN or infinite number");
    }
    if intrinsics[0][0] <= 0.0 || intrinsics[1][1] <= 0.0 {
        return Err("its focal lengths are not above 0");
    }
    if intrinsics[1][0] != 0.0 || intrinsics[2] != [0.0, 0.0, 1.0] {
        return Err("its intrinsics are not fx, skew, cx / 0, fy, cy / 0, 0, 1");
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use omnix_geometry::IDENTITY_POSE;

    use super::*;

    const K: [[f32; 3]; 3] = [[2.0, 0.0, 1.5], [0.0, 2.0, 1.0], [0.0, 0.0, 1.0]];

    fn parts() -> SampleParts {
        let (count, pixels) = (2, 6);
        SampleParts {
            size: [3, 2],
            images: vec![0; count * pixels * 3],
            times: vec![Time::default(); count],
            cameras: vec![Camera { extrinsics: IDENTITY_POSE, intrinsics: K }; count],
            depth: Some((0..count * pixels).map(|k| k as f32 + 1.0).collect()),
            moving: Some(vec![Flag::No; count * pixels]),
            motion: Motion::Dense(Dense {
                positions: (0..count * count * pixels).map(|k| [k as f32; 3]).collect(),
                visible: Some(vec![Flag::Yes; count * count * pixels]),
            }),
            unit: Unit::Metre,
        }
    }

    fn error(change: impl FnOnce(&mut SampleParts)) -> String {
        let mut parts = parts();
        change(&mut parts);
        Sample::new(parts).unwrap_err().to_string()
    }

    #[test]
    fn maps_lie_where_the_layout_says() {
        let sample = Sample::new(parts()).unwrap();
        assert_eq!((sample.count(), sample.size(), sample.pixels()), (2, [3, 2], 6));
        assert_eq!(sample.depth(1).unwrap()[0], 7.0);
        // Source 1, time 0 is the third map of 6.
        assert_eq!(sample.positions(1, 0).unwrap()[2], [14.0; 3]);
        assert_eq!(sample.visible(1, 1).unwrap().len(), 6);
        assert!(sample.valid(0, 0));
    }

    #[test]
    fn lists_of_other_lengths_are_named() {
        assert!(error(|p| p.images.truncate(35)).starts_with("images of a sample: 35 entries"));
        assert!(error(|p| p.depth = Some(vec![1.0; 6])).contains("[T][H][W] has 12"));
        assert!(error(|p| p.cameras.truncate(1)).starts_with("cameras"));
        assert!(error(|p| p.motion = Motion::Dense(Dense::default())).starts_with("positions"));
        let tracks = Tracks { count: usize::MAX, ..Tracks::default() };
        assert!(error(|p| p.motion = Motion::Tracks(tracks)).starts_with("positions of tracks"));
        assert!(error(|p| p.size = [u32::MAX, u32::MAX]).starts_with("images"));
        assert!(error(|p| p.times.clear()).contains("0 images"));
    }

    #[test]
    fn conventions_hold() {
        for wrong in [0.0, -1.0, f32::INFINITY] {
            assert!(error(|p| p.depth.as_mut().unwrap()[3] = wrong).starts_with("depth[3]"));
        }
        for wrong in [[f32::NAN, 0.0, 0.0], [f32::INFINITY; 3]] {
            let text = error(|p| match &mut p.motion {
                Motion::Dense(dense) => dense.positions[5] = wrong,
                _ => unreachable!(),
            });
            assert!(text.starts_with("positions[5]"), "{text}");
        }
        assert!(error(|p| p.cameras[1].intrinsics[0][0] = 0.0).starts_with("camera 1"));
        assert!(error(|p| p.cameras[1].extrinsics[0][3] = f32::NAN).contains("NaN"));
        assert!(error(|p| p.cameras[0].intrinsics[2][2] = 2.0).contains("intrinsics"));
    }

    #[test]
    fn unknown_depth_is_not_valid() {
        let mut parts = parts();
        parts.depth.as_mut().unwrap()[2] = f32::NAN;
        let sample = Sample::new(parts).unwrap();
        assert!(!sample.valid(0, 2) && sample.valid(0, 1));
    }
}
