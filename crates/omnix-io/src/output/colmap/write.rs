//! The three files of a model, in both forms. Numbers of cameras, images and points begin at 1.

use std::fmt::Write as _;
use std::path::PathBuf;

use super::model::Image;
use super::points::Point;
use crate::IoError;
use crate::output::atomic::AtomicFile;

/// How a model's files are written.
pub(super) struct Form {
    head: fn(&str, usize) -> Vec<u8>,
    camera: fn(u32, &Image) -> Vec<u8>,
    image: fn(u32, &Image) -> Vec<u8>,
    point: fn(u64, &Point) -> Vec<u8>,
}

/// COLMAP's number of the model PINHOLE.
const PINHOLE: i32 = 1;

/// Little endian; a count, then each.
pub(super) const BINARY: Form = Form {
    head: |_, count| (count as u64).to_le_bytes().to_vec(),
    camera: |id, image| {
        let mut bytes = [id.to_le_bytes(), PINHOLE.to_le_bytes()].concat();
        bytes.extend(image.size.map(|side| u64::from(side).to_le_bytes()).concat());
        bytes.extend(image.pinhole.map(f64::to_le_bytes).concat());
        bytes
    },
    image: |id, image| {
        let (q, t) = (image.rotation, image.translation);
        let mut bytes = id.to_le_bytes().to_vec();
        bytes.extend([q.w, q.x, q.y, q.z, t.x, t.y, t.z].map(f64::to_le_bytes).concat());
        bytes.extend(id.to_le_bytes());
        bytes.extend(image.name.as_bytes());
        bytes.push(0);
        bytes.extend((image.seen.len() as u64).to_le_bytes());
        for (place, point) in &image.seen {
            bytes.extend(place.map(f64::to_le_bytes).concat());
            bytes.extend((i64::from(*point) + 1).to_le_bytes());
        }
        bytes
    },
    point: |id, point| {
        let mut bytes = id.to_le_bytes().to_vec();
        bytes.extend(point.position.to_array().map(f64::to_le_bytes).concat());
        bytes.extend(point.colour);
        bytes.extend(0f64.to_le_bytes());
        bytes.extend((point.track.len() as u64).to_le_bytes());
        for (image, observation) in &point.track {
            bytes.extend([(image + 1).to_le_bytes(), observation.to_le_bytes()].concat());
        }
        bytes
    },
};

/// A line each, two for an image. Numbers in the fewest digits that give them back.
pub(super) const TEXT: Form = Form {
    head: |columns, count| format!("# {columns}\n# {count} in all\n").into_bytes(),
    camera: |id, image| {
        let ([w, h], [fx, fy, cx, cy]) = (image.size, image.pinhole);
        format!("{id} PINHOLE {w} {h} {fx} {fy} {cx} {cy}\n").into_bytes()
    },
    image: |id, image| {
        let (q, t) = (image.rotation, image.translation);
        let mut text = format!("{id} {} {} {} {} {} {} {} {id} {}\n", q.w, q.x, q.y, q.z, t.x, t.y, t.z, image.name);
        for (k, ([x, y], point)) in image.seen.iter().enumerate() {
            // Writing to a string cannot fail.
            let _ = write!(text, "{}{x} {y} {}", if k > 0 { " " } else { "" }, point + 1);
        }
        text.push('\n');
        text.into_bytes()
    },
    point: |id, point| {
        let ([x, y, z], [r, g, b]) = (point.position.to_array(), point.colour);
        let mut text = format!("{id} {x} {y} {z} {r} {g} {b} 0");
        for (image, observation) in &point.track {
            let _ = write!(text, " {} {observation}", image + 1);
        }
        text.push('\n');
        text.into_bytes()
    },
};

impl Form {
    pub(super) fn cameras(&self, path: PathBuf, images: &[Image]) -> Result<PathBuf, IoError> {
        let all = images.iter().zip(1..).map(|(image, id)| (self.camera)(id, image));
        self.write(path, "CAMERA_ID MODEL WIDTH HEIGHT PARAMS[]", images.len(), all)
    }

    pub(super) fn images(&self, path: PathBuf, images: &[Image]) -> Result<PathBuf, IoError> {
        let all = images.iter().zip(1..).map(|(image, id)| (self.image)(id, image));
        self.write(
            path,
            "IMAGE_ID QW QX QY QZ TX TY TZ CAMERA_ID NAME, then POINTS2D[] as X Y POINT3D_ID",
            images.len(),
            all,
        )
    }

    pub(super) fn points(&self, path: PathBuf, points: &[Point]) -> Result<PathBuf, IoError> {
        let all = points.iter().zip(1..).map(|(point, id)| (self.point)(id, point));
        self.write(path, "POINT3D_ID X Y Z R G B ERROR TRACK[] as IMAGE_ID POINT2D_IDX", points.len(), all)
    }

    fn write(
        &self,
        path: PathBuf,
        columns: &str,
        count: usize,
        all: impl Iterator<Item = Vec<u8>>,
    ) -> Result<PathBuf, IoError> {
        let mut file = AtomicFile::create(path)?;
        file.put(&(self.head)(columns, count))?;
        for bytes in all {
            file.put(&bytes)?;
        }
        file.commit()
    }
}
