//! Labels that no layout has and that are asked for by name, beside the files of either:
//!
//! ```text
//! normals/cam_CC/frame_NNNN.npy     f32 [H,W,3] unit normal of the surface, on the side towards the camera, in its axes
//!                                   (x right, y down, z forward); NaN for the sky
//! flow/cam_CC/frame_NNNN.npy        f32 [H,W,2] pixels to the right and down from here to where the point is in the next
//!                                   frame of the same camera, hidden or not; NaN for the sky and behind that camera;
//!                                   none of the last frame
//! ```

use serde::{Deserialize, Serialize};

use super::files::{Files, Take};
use super::numpy::{f32_bytes, npy};
use crate::cast::Geometry;
use crate::error::ScenesError;
use crate::labels::{flow, normals};
use crate::view::View;

/// Which of them are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Labels {
    /// Normals of surfaces.
    pub normals: bool,
    /// Optical flow to the next frame.
    pub flow: bool,
}

impl Labels {
    /// Bytes of an image's.
    pub(super) const fn bytes(self, pixels: u64) -> u64 {
        pixels.saturating_mul(12 * self.normals as u64 + 8 * self.flow as u64)
    }

    /// Writes those of an image, which shows `state`; `next` is the camera and the state of the next frame, where there is one.
    pub(super) fn write(
        self,
        files: &Files,
        take: &Take,
        state: &Geometry,
        next: Option<(View, &Geometry)>,
    ) -> Result<(), ScenesError> {
        let [width, height] = take.view.size;
        let name = |kind: &str| format!("{kind}/cam_{:02}/frame_{:04}.npy", take.camera, take.frame);
        if self.normals {
            let values = normals(&take.view, state, &take.hits);
            files.put(&name("normals"), &npy("<f4", &[height, width, 3], &f32_bytes(values.into_iter().flatten())))?;
        }
        if let (true, Some((view, then))) = (self.flow, next) {
            let values = flow(&take.view, (&view, then), &take.hits);
            files.put(&name("flow"), &npy("<f4", &[height, width, 2], &f32_bytes(values.into_iter().flatten())))?;
        }
        Ok(())
    }
}
