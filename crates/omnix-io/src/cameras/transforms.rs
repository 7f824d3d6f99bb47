//! `transforms.json` of nerfstudio and instant-ngp (nerfstudio's documentation, "Data conventions").
//!
//! Poses are camera-to-world with OpenGL axes (x right, y up, z back). A lens is said once for all frames, or by a frame for itself.

use std::path::Path;

use glam::{DMat3, DVec3};
use serde::Deserialize;

use super::given::{GivenCamera, GivenCameras, PictureKey, text};
use super::lens::{Distortion, Lens};
use super::pose;
use crate::IoError;

#[derive(Debug, Deserialize)]
struct Transforms {
    #[serde(flatten)]
    lens: LensFields,
    frames: Vec<Frame>,
}

#[derive(Debug, Deserialize)]
struct Frame {
    file_path: String,
    transform_matrix: Vec<Vec<f64>>,
    #[serde(flatten)]
    lens: LensFields,
}

#[derive(Debug, Clone, Default, Deserialize)]
struct LensFields {
    camera_model: Option<String>,
    is_fisheye: Option<bool>,
    camera_angle_x: Option<f64>,
    camera_angle_y: Option<f64>,
    fl_x: Option<f64>,
    fl_y: Option<f64>,
    cx: Option<f64>,
    cy: Option<f64>,
    w: Option<f64>,
    h: Option<f64>,
    k1: Option<f64>,
    k2: Option<f64>,
    k3: Option<f64>,
    k4: Option<f64>,
    p1: Option<f64>,
    p2: Option<f64>,
}

pub(super) fn read(path: &Path) -> Result<GivenCameras, IoError> {
    let bad = |reason: String| IoError::BadCameras { reason, path: path.to_owned() };
    let file: Transforms =
        serde_json::from_str(&text(path)?).map_err(|error| bad(format!("it is no transforms.json: {error}")))?;
    let mut cameras = Vec::with_capacity(file.frames.len());
    for frame in &file.frames {
        let at = |reason: &str| bad(format!("frame {}: {reason}", frame.file_path.escape_debug()));
        let fields = frame.lens.clone().or(&file.lens);
        let (lens, size) = fields.lens().map_err(|reason| at(&reason))?;
        let world_to_camera = world_to_camera(&frame.transform_matrix).map_err(at)?;
        cameras.push(GivenCamera {
            picture: PictureKey::Name(frame.file_path.clone()),
            size: Some(size),
            lens,
            world_to_camera,
        });
    }
    Ok(GivenCameras { cameras, format: "transforms.json", path: path.to_owned() })
}

fn world_to_camera(matrix: &[Vec<f64>]) -> Result<[[f32; 4]; 3], &'static str> {
    if !(3..=4).contains(&matrix.len()) || matrix.iter().any(|row| row.len() != 4) {
        return Err("transform_matrix has 3 or 4 rows of 4 numbers");
    }
    let column = |c: usize| DVec3::new(matrix[0][c], matrix[1][c], matrix[2][c]);
    // OpenGL's y and z point the other way.
    pose::from_camera_to_world(DMat3::from_cols(column(0), -column(1), -column(2)), column(3))
}

impl LensFields {
    /// These, or those of all frames where they are not given.
    fn or(self, all: &Self) -> Self {
        macro_rules! either {
            ($($field:ident)*) => { Self { $($field: self.$field.or(all.$field.clone()),)* } };
        }
        either!(camera_model is_fisheye camera_angle_x camera_angle_y fl_x fl_y cx cy w h k1 k2 k3 k4 p1 p2)
    }

    fn lens(&self) -> Result<(Lens, [u32; 2]), String> {
        if let Some(model) = self
            .camera_model
            .as_deref()
            .filter(|m| !["OPENCV", "PINHOLE", "SIMPLE_PINHOLE", "SIMPLE_RADIAL", "RADIAL"].contains(m))
        {
            return Err(format!(
                "a camera of the model {}, whose distortion cannot be taken out here: undistort the pictures first",
                model.escape_debug()
            ));
        }
        // A fourth radial coefficient belongs to fisheye lenses.
        if self.is_fisheye == Some(true) || self.k4.is_some_and(|k4| k4 != 0.0) {
            return Err(
                "a fisheye lens, whose distortion cannot be taken out here: undistort the pictures first".to_owned()
            );
        }
        let side = |value: Option<f64>| value.filter(|v| v.fract() == 0.0 && (1.0..1e6).contains(v)).map(|v| v as u32);
        let (Some(w), Some(h)) = (side(self.w), side(self.h)) else {
            return Err("w and h, the size of the pictures in pixels, are needed".to_owned());
        };
        let by_angle = |angle: Option<f64>, side: u32| angle.map(|angle| f64::from(side) / 2.0 / (angle / 2.0).tan());
        let across = self.fl_x.or(by_angle(self.camera_angle_x, w));
        let down = self.fl_y.or(by_angle(self.camera_angle_y, h)).or(across);
        let (Some(fx), Some(fy)) = (across.or(down), down) else {
            return Err("a focal length is needed: fl_x (and fl_y), or camera_angle_x".to_owned());
        };
        let centre = match (self.cx, self.cy) {
            (Some(cx), Some(cy)) => Some([cx, cy]),
            (None, None) => None,
            _ => return Err("cx and cy are given together".to_owned()),
        };
        let or_zero = |value: Option<f64>| value.unwrap_or(0.0);
        let distortion = Distortion {
            radial: [self.k1, self.k2, self.k3, None, None, None].map(or_zero),
            tangential: [self.p1, self.p2].map(or_zero),
        };
        let finite = distortion
            .radial
            .iter()
            .chain(&distortion.tangential)
            .chain(centre.iter().flatten())
            .all(|v| v.is_finite());
        if !(finite && fx > 0.0 && fy > 0.0 && fx.is_finite() && fy.is_finite()) {
            return Err("a number of its lens is not finite, or its focal length is not above 0".to_owned());
        }
        Ok((Lens { focal: [fx, fy], centre, distortion }, [w, h]))
    }
}
