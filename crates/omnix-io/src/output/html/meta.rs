//! The page's JSON: everything but the points themselves and the pictures.

use glam::{DMat3, DVec3};
use serde_json::{Value, json};

use super::super::motion::{MotionView, MovingPoints};
use super::super::options::HtmlOptions;
use super::{encode, encode::PositionBox, order::Order};

/// `omnix-meta` as text for its script element.
pub(super) fn meta(
    points: &MovingPoints,
    options: &HtmlOptions,
    order: &Order,
    positions: &PositionBox,
    confidence: [f32; 2],
) -> String {
    encode::script_json(&json!({
        "version": 1,
        "program": concat!("omnix ", env!("CARGO_PKG_VERSION")),
        "title": options.title,
        "notes": options.notes,
        "unit": options.unit,
        "points": order.points.len(),
        "changing": order.changing,
        "moving": order.all().filter(|&point| points.moving[point]).count(),
        "left_out": points.len() - order.points.len(),
        "box": { "low": positions.low, "high": positions.high },
        "confidence": confidence,
        "views": points.views.iter().map(view).collect::<Vec<_>>(),
    }))
}

fn view(view: &MotionView) -> Value {
    json!({
        "video": view.time.video,
        "frame": view.time.frame,
        // Not a number is null, as if it were not known.
        "seconds": view.time.time_s,
        "width": view.picture.width,
        "height": view.picture.height,
        "camera": camera(view),
    })
}

/// A camera in world axes, or null when it cannot be inverted.
///
/// `corners`: from the centre to the picture's corners (top left, top right, bottom right, bottom left) at depth 1; pixel
/// positions are at whole numbers, so the picture reaches half a pixel further. `fov`: horizontal and vertical, degrees.
/// `pixel`: width of a pixel at depth 1.
fn camera(view: &MotionView) -> Value {
    let rows = |m: [[f32; 3]; 3]| DMat3::from_cols_array_2d(&m.map(|row| row.map(f64::from))).transpose();
    let rotation = rows(view.extrinsics.map(|[a, b, c, _]| [a, b, c]));
    let translation = DVec3::from_array(view.extrinsics.map(|row| f64::from(row[3])));
    let (back, rays) = (rotation.inverse(), rows(view.intrinsics).inverse());
    let centre = back * -translation;
    if !(back.is_finite() && rays.is_finite() && centre.is_finite()) {
        return Value::Null;
    }
    let (width, height) = (f64::from(view.picture.width), f64::from(view.picture.height));
    let ray = |u: f64, v: f64| rays * DVec3::new(u, v, 1.0);
    let (left, right, top, bottom) = (-0.5, width - 0.5, -0.5, height - 0.5);
    let corners = [ray(left, top), ray(right, top), ray(right, bottom), ray(left, bottom)];
    let middle = [(left + right) / 2.0, (top + bottom) / 2.0];
    let fov = [
        ray(left, middle[1]).angle_between(ray(right, middle[1])),
        ray(middle[0], top).angle_between(ray(middle[0], bottom)),
    ];
    json!({
        "centre": number(centre),
        "forward": number(back * DVec3::Z),
        "up": number(back * -DVec3::Y),
        "corners": corners.map(|corner| number(back * corner)),
        "fov": fov.map(|angle| angle.to_degrees() as f32),
        "pixel": rays.x_axis.x as f32,
    })
}

/// Single precision, for the shortest text.
fn number(v: DVec3) -> [f32; 3] {
    v.as_vec3().to_array()
}
