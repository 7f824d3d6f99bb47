//! `usda`: the followed points and the cameras as Universal Scene Description in text (openusd.org, "USD Schemas": UsdGeomPoints,
//! UsdGeomCamera), for Blender, Houdini, Maya, Omniverse and usdview.
//!
//! One prim of points whose positions have a sample at each time, and a camera for each video with a sample at each of its images. Axes are
//! USD's and OpenGL's (x right, y up, z back), so y and z are negated. A time code is an image's index; the frame rate of the run says how
//! long one lasts. Positions are in the run's own unit, which USD takes for metres.

use std::collections::BTreeMap;
use std::io::Write as _;
use std::path::{Path, PathBuf};

use glam::DMat3;

use super::atomic::AtomicFile;
use super::camera::Camera;
use super::colour::linear16;
use super::format::{FileKind, Format, Points};
use super::motion::{MotionView, MovingPoints};
use super::options::check_rate;
use crate::IoError;

const NAME: &str = "scene.usda";

pub(super) const FORMAT: Format = Format {
    name: "usda",
    needs_cameras: true,
    needs_motion: true,
    files: &[FileKind::one(
        NAME,
        "the followed points and the cameras with a sample at each time, axes x right, y up, z back",
    )
    .with(Points::Network)],
    disk: |size| size.paths(size.moving(), 45, 40).saturating_add(size.images.saturating_mul(1000)),
    points: Some(|dir, points, options| Ok(vec![write(&dir.join(NAME), points, options.fps)?])),
    ..Format::NONE
};

/// Width of a film in millimetres, that of 35 mm still cameras; focal lengths are in the same unit.
const FILM: f64 = 36.0;
/// Width of a point in parts of the points' spread.
const POINT: f64 = 0.004;

fn write(path: &Path, points: &MovingPoints, fps: f64) -> Result<PathBuf, IoError> {
    points.check(FORMAT.name)?;
    check_rate(fps)?;
    let times = points.views.len();
    // A number that is not finite could make the whole file unreadable.
    let finite = |k: &usize| (0..times).all(|time| points.position(time, *k).iter().all(|v| v.is_finite()));
    let kept: Vec<usize> = (0..points.len()).filter(finite).collect();
    if kept.is_empty() {
        return Err(IoError::NoPoints { export: FORMAT.name });
    }
    let mut file = AtomicFile::create(path.to_owned())?;
    let mut put = |text: &str| file.writer().write_all(text.as_bytes()).map_err(|e| IoError::write(path, e));
    put(&format!(
        "#usda 1.0\n(\n    defaultPrim = \"scene\"\n    upAxis = \"Y\"\n    metersPerUnit = 1\n    startTimeCode = 0\n    endTimeCode = {}\n    \
         timeCodesPerSecond = {fps}\n)\n\ndef Xform \"scene\"\n{{\n    def Points \"points\"\n    {{\n        point3f[] points.timeSamples = {{\n",
        times - 1
    ))?;
    for time in 0..times {
        put(&format!("            {time}: ["))?;
        for (n, &k) in kept.iter().enumerate() {
            let [x, y, z] = points.position(time, k);
            put(&format!("{}({x}, {}, {})", separator(n), -y, -z))?;
        }
        put("],\n")?;
    }
    put("        }\n        color3f[] primvars:displayColor = [")?;
    for (n, &k) in kept.iter().enumerate() {
        // USD's colours are linear, pictures are sRGB.
        let [r, g, b] = points.colours[k].map(|value| f64::from(linear16(value)) / 65535.0);
        put(&format!("{}({r:.4}, {g:.4}, {b:.4})", separator(n)))?;
    }
    put("] (\n            interpolation = \"vertex\"\n        )\n")?;
    put(&format!(
        "        float[] widths = [{}] (\n            interpolation = \"constant\"\n        )\n    }}\n",
        width(points)
    ))?;
    let mut videos: BTreeMap<u32, Vec<(usize, &MotionView)>> = BTreeMap::new();
    for (time, view) in points.views.iter().enumerate() {
        videos.entry(view.time.video).or_default().push((time, view));
    }
    for (video, views) in &videos {
        put(&camera(*video, views)?)?;
    }
    put("}\n")?;
    file.commit()
}

/// What stands before item k of a list.
const fn separator(k: usize) -> &'static str {
    if k == 0 { "" } else { ", " }
}

/// The width of points: a share of the middle half of their positions along their widest axis, at the first time.
fn width(points: &MovingPoints) -> f64 {
    let spread = |axis: usize| {
        let mut all: Vec<f32> =
            (0..points.len()).map(|k| points.position(0, k)[axis]).filter(|v| v.is_finite()).collect();
        all.sort_unstable_by(f32::total_cmp);
        all.get(all.len() / 4 * 3).zip(all.get(all.len() / 4)).map_or(0.0, |(high, low)| f64::from(high - low))
    };
    (0..3).map(spread).fold(0.0, f64::max).max(1e-6) * POINT
}

/// A camera with a sample at each of its images.
fn camera(video: u32, views: &[(usize, &MotionView)]) -> Result<String, IoError> {
    let (mut matrices, mut lenses) = (String::new(), [const { String::new() }; 5]);
    for &(time, view) in views {
        let bad = || IoError::MissingField { export: FORMAT.name, missing: "an invertible camera", index: time };
        let (rotation, centre) = Camera::new(view.extrinsics, view.intrinsics).ok_or_else(bad)?.camera_to_world();
        // Both worlds and both cameras have y and z turned; USD's matrices act on rows.
        let flip = DMat3::from_diagonal([1.0, -1.0, -1.0].into());
        let (turned, at) = (flip * rotation * flip, flip * centre);
        let row = |c: usize| format!("({}, {}, {}, 0)", turned.col(c).x, turned.col(c).y, turned.col(c).z);
        matrices +=
            &format!("            {time}: ({}, {}, {}, ({}, {}, {}, 1)),\n", row(0), row(1), row(2), at.x, at.y, at.z);
        let [[fx, _, cx], [_, fy, cy], _] = view.intrinsics.map(|row| row.map(f64::from));
        let (w, h) = (f64::from(view.picture.width), f64::from(view.picture.height));
        // Millimetres of film for a pixel, such that one focal length serves both axes.
        let (across, down) = (FILM / w, FILM / w * fx / fy);
        let values = [fx * across, FILM, h * down, (w / 2.0 - cx) * across, (cy - h / 2.0) * down];
        for (lens, value) in lenses.iter_mut().zip(values) {
            *lens += &format!("            {time}: {value},\n");
        }
    }
    let names =
        ["focalLength", "horizontalAperture", "verticalAperture", "horizontalApertureOffset", "verticalApertureOffset"];
    let lenses: String = names
        .iter()
        .zip(&lenses)
        .map(|(name, samples)| format!("        float {name}.timeSamples = {{\n{samples}        }}\n"))
        .collect();
    Ok(format!(
        "    def Camera \"camera_{video}\"\n    {{\n        matrix4d xformOp:transform.timeSamples = {{\n{matrices}        }}\n        \
         uniform token[] xformOpOrder = [\"xformOp:transform\"]\n{lenses}        float2 clippingRange = (0.01, 10000)\n    }}\n"
    ))
}
