//! The paths of a network as predictions of a scene of trajectories.

use std::path::PathBuf;

use super::network::{Network, Seen};
use crate::files::tracks::{PixelSet, SourceTracks};
use crate::kinds::trajectories::ScenePrediction;
use crate::{EvalError, Rigid};

/// What the network says of the clip that it saw last.
pub(super) struct NetworkPaths<'a> {
    network: &'a mut dyn Network,
    size: [usize; 2],
    extrinsics: Vec<Rigid>,
    focal: Vec<[f64; 2]>,
    place: PathBuf,
}

impl<'a> NetworkPaths<'a> {
    /// Of a clip of this size; `place` is where its pictures lie.
    ///
    /// # Errors
    /// [`EvalError::Nothing`] for a camera that is not finite.
    pub(super) fn new(
        network: &'a mut dyn Network,
        seen: &Seen,
        size: [u32; 2],
        place: PathBuf,
    ) -> Result<Self, EvalError> {
        let extrinsics = world_to_camera(seen)?;
        let focal = seen.cameras.iter().map(|c| [c.intrinsics[0][0], c.intrinsics[1][1]].map(f64::from)).collect();
        Ok(Self { network, size: size.map(|side| side as usize), extrinsics, focal, place })
    }
}

/// The poses of a network's cameras, world-to-camera.
pub(super) fn world_to_camera(seen: &Seen) -> Result<Vec<Rigid>, EvalError> {
    let poses = seen.cameras.iter().map(|camera| Rigid::from_rows(&camera.extrinsics.map(|row| row.map(f64::from))));
    let poses: Option<Vec<Rigid>> = poses.collect();
    poses.ok_or_else(|| EvalError::Nothing { reason: "a predicted camera has a NaN or infinite number".to_owned() })
}

impl ScenePrediction for NetworkPaths<'_> {
    fn sources(&mut self) -> Result<Vec<usize>, EvalError> {
        Ok((0..self.extrinsics.len()).collect())
    }

    fn source(&mut self, image: usize) -> Result<SourceTracks, EvalError> {
        let paths = self.network.paths(image, None)?;
        let times = self.extrinsics.len();
        EvalError::expect("positions of paths, [T][pixel]", paths.len(), times * self.size[0] * self.size[1])?;
        Ok(SourceTracks {
            times,
            pixels: PixelSet::All(self.size),
            points: paths.into_iter().map(|point| point.map(f64::from)).collect(),
            moving: None,
            extrinsics: self.extrinsics.clone(),
            focal: self.focal.clone(),
        })
    }

    fn place(&self, _: usize) -> PathBuf {
        self.place.clone()
    }
}
