//! One HTML file that plays points that move, in any browser with WebGL 2, without a network.
//!
//! The page is `html/template.html` with its style, three.js (`assets/three`, MIT) and the parts of the viewer
//! (`html/*.js`) inlined, and the data as script elements that browsers do not run. A content security policy in the page
//! forbids every connection. All numbers are little-endian, base64 (RFC 4648) where binary:
//!
//! | element            | holds                                                                              |
//! |--------------------|------------------------------------------------------------------------------------|
//! | `omnix-meta`       | JSON: title, notes, counts, box of positions, views with their cameras and times    |
//! | `omnix-look`       | u8 × 4 per point: red, green, blue, 255 where the gate let it move                   |
//! | `omnix-scalars`    | u16 × 4 per point: source view, θ × 65535, confidence on a logarithmic scale, 0      |
//! | `omnix-pixels`     | u16 × 2 a point: column and row in its source view                                  |
//! | `omnix-path-T`     | u16 × 3 per point that changes place, at time T, in the box of positions            |
//! | `omnix-still`      | u16 × 3 per point that is in one place at all times                                 |
//! | `omnix-picture-V`  | the picture of view V, reduced, JPEG                                               |
//!
//! Points that change place come first; each half keeps the order of the source. Points with a position that is not finite
//! are left out and counted. Written as it is encoded: beside the input it needs memory for one picture and 4 bytes per point.

mod encode;
mod meta;
mod order;

use std::path::{Path, PathBuf};

use image::{codecs::jpeg::JpegEncoder, imageops};

pub use super::options::HtmlOptions;
use super::{
    atomic::AtomicFile,
    format::{FileKind, Format, Points},
    motion::MovingPoints,
};
use crate::{IoError, Picture};
use encode::{Base64, PositionBox, confidence_code, unit_code};
use order::Order;

const NAME: &str = "scene.html";

pub(super) const FORMAT: Format = Format {
    name: "html",
    needs_cameras: true,
    needs_motion: true,
    by_default: true,
    files: &[FileKind::one(NAME, "a viewer of the moving points, complete in one file: open it in a browser")
        .with(Points::Network)],
    // Base64 of six bytes per point and time; the pictures; the viewer.
    disk: |size| {
        let points = size.paths(size.moving(), 8, 24);
        points.saturating_add(size.images.saturating_mul(64_000)).saturating_add(1 << 20)
    },
    memory: |size| size.path_memory(5),
    points: Some(|dir, points, options| Ok(vec![write_html(points, &options.html, &dir.join(NAME))?])),
    ..Format::NONE
};

const TEMPLATE: &str = include_str!("html/template.html");
const STYLE: &str = include_str!("html/style.css");
const THREE: &str = include_str!("../../assets/three/three.min.js");
const THREE_LICENCE: &str = include_str!("../../assets/three/LICENSE");
/// Classic scripts, in this order, that share one function's scope.
const VIEWER: [&str; 9] = [
    include_str!("html/data.js"),
    include_str!("html/shaders.js"),
    include_str!("html/points.js"),
    include_str!("html/trails.js"),
    include_str!("html/cameras.js"),
    include_str!("html/stage.js"),
    include_str!("html/panel.js"),
    include_str!("html/inspect.js"),
    include_str!("html/main.js"),
];

/// Writes the page; a file of that name is replaced when the new one is whole. Returns its path.
///
/// # Errors
/// No views, buffers of `points` that do not fit together, a full disk or other failure of writing.
pub fn write_html(points: &MovingPoints, options: &HtmlOptions, path: &Path) -> Result<PathBuf, IoError> {
    check(points)?;
    let order = Order::of(points);
    let positions = PositionBox::of(points, order.all());
    let confidence = encode::confidence_range(points, order.all());
    let meta = meta::meta(points, options, &order, &positions, confidence);

    let mut file = AtomicFile::create(path.to_owned())?;
    let mut rest = TEMPLATE;
    for name in ["title", "style", "licence", "data", "three", "viewer"] {
        let (before, after) = rest
            .split_once(&format!("<!--omnix:{name}-->"))
            .expect("BUG: the template of the HTML viewer lacks a place of its own");
        file.put(before.as_bytes())?;
        rest = after;
        match name {
            "title" => file.put(encode::escape(&options.title).as_bytes())?,
            "style" => file.put(STYLE.as_bytes())?,
            "licence" => file.put(THREE_LICENCE.trim().as_bytes())?,
            "data" => {
                file.put(format!("<script type=\"application/json\" id=\"omnix-meta\">{meta}</script>\n").as_bytes())?;
                write_points(&mut file, points, &order, &positions, confidence)?;
                write_pictures(&mut file, points, options, path)?;
            }
            "three" => file.put(THREE.as_bytes())?,
            _ => VIEWER.iter().try_for_each(|part| file.put(part.as_bytes()))?,
        }
    }
    file.put(rest.as_bytes())?;
    file.commit()
}

fn check(points: &MovingPoints) -> Result<(), IoError> {
    if points.views.is_empty() {
        return Err(IoError::MissingField { export: FORMAT.name, missing: "a view", index: 0 });
    }
    let n = points.len();
    let lengths = [
        ("pixels", points.pixel.len(), n),
        ("positions", points.positions.len(), points.views.len() * n * 3),
        ("colours", points.colours.len(), n),
        ("motion scores", points.motion.len(), n),
        ("confidence", points.confidence.len(), n),
        ("gates", points.moving.len(), n),
    ];
    for (what, found, expected) in lengths {
        if found != expected {
            return Err(IoError::WrongSize { export: FORMAT.name, what, index: 0, expected, found });
        }
    }
    for &source in &points.source {
        if source as usize >= points.views.len() {
            return Err(IoError::MissingField { export: FORMAT.name, missing: "a view", index: source as usize });
        }
    }
    Ok(())
}

fn write_points(
    file: &mut AtomicFile,
    points: &MovingPoints,
    order: &Order,
    positions: &PositionBox,
    confidence: [f32; 2],
) -> Result<(), IoError> {
    section(file, "omnix-look", |out| {
        order.all().try_for_each(|point| {
            let [r, g, b] = points.colours[point];
            out.put(&[r, g, b, if points.moving[point] { 255 } else { 0 }])
        })
    })?;
    section(file, "omnix-scalars", |out| {
        order.all().try_for_each(|point| {
            let source = u16::try_from(points.source[point]).unwrap_or(u16::MAX);
            let scalars =
                [source, unit_code(points.motion[point]), confidence_code(points.confidence[point], confidence), 0];
            scalars.into_iter().try_for_each(|value| out.put(&value.to_le_bytes()))
        })
    })?;
    section(file, "omnix-pixels", |out| {
        order.all().try_for_each(|point| {
            let pixel = points.pixel[point].map(|v| u16::try_from(v).unwrap_or(u16::MAX));
            pixel.into_iter().try_for_each(|value| out.put(&value.to_le_bytes()))
        })
    })?;
    let (changing, still) = order.points.split_at(order.changing);
    for time in 0..points.views.len() {
        section(file, &format!("omnix-path-{time}"), |out| place_all(out, points, positions, time, changing))?;
    }
    section(file, "omnix-still", |out| place_all(out, points, positions, 0, still))
}

fn place_all(
    out: &mut Base64<'_>,
    points: &MovingPoints,
    positions: &PositionBox,
    time: usize,
    which: &[u32],
) -> Result<(), IoError> {
    which.iter().try_for_each(|&point| {
        let codes = positions.codes(points.position(time, point as usize));
        codes.into_iter().try_for_each(|value| out.put(&value.to_le_bytes()))
    })
}

fn write_pictures(
    file: &mut AtomicFile,
    points: &MovingPoints,
    options: &HtmlOptions,
    path: &Path,
) -> Result<(), IoError> {
    for (index, view) in points.views.iter().enumerate() {
        let jpeg = thumbnail(&view.picture, options, path)?;
        section(file, &format!("omnix-picture-{index}"), |out| out.put(&jpeg))?;
    }
    Ok(())
}

/// The picture, reduced to the options' width, as JPEG.
fn thumbnail(picture: &Picture, options: &HtmlOptions, path: &Path) -> Result<Vec<u8>, IoError> {
    let width = options.thumbnail_width.clamp(1, picture.width);
    let height = ((u64::from(picture.height) * u64::from(width) / u64::from(picture.width)) as u32).max(1);
    let full = image::RgbImage::from_raw(picture.width, picture.height, picture.data.clone())
        .expect("BUG: a picture holds width x height x 3 bytes");
    let small = if width < picture.width { imageops::thumbnail(&full, width, height) } else { full };
    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, options.jpeg_quality.clamp(1, 100))
        .encode_image(&small)
        .map_err(|e| IoError::write(path, std::io::Error::other(e)))?;
    Ok(jpeg)
}

/// A script element that browsers do not run, with what `fill` writes as base64.
fn section(
    file: &mut AtomicFile,
    id: &str,
    fill: impl FnOnce(&mut Base64<'_>) -> Result<(), IoError>,
) -> Result<(), IoError> {
    file.put(format!("<script type=\"application/octet-stream\" id=\"{id}\">").as_bytes())?;
    let mut out = Base64::new(file);
    fill(&mut out)?;
    out.finish()?;
    file.put(b"</script>\n")
}

#[cfg(test)]
mod tests;
